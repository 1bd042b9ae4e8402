"""An environment after Gymnasium's interface: the plant, moved by an agent."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ._plant import Plant, PlantState
from ._scenario import Scenario, as_scenario

try:
    from gymnasium import Env as _Base
    from gymnasium.spaces import Box
except ImportError:  # Debian 12 has no Gymnasium
    _Base = object

    class Box:
        """A box of numbers, with what agents use of gymnasium.spaces.Box."""

        def __init__(self, low, high, shape=None, dtype=np.float64):
            self.shape = np.shape(low) if shape is None else tuple(shape)
            self.dtype = np.dtype(dtype)
            self.low, self.high = (np.broadcast_to(np.asarray(bound, dtype), self.shape).copy() for bound in (low, high))
            self._random = np.random.default_rng()

        def seed(self, seed: int | None = None) -> None:
            """Makes the samples those of this seed."""
            self._random = np.random.default_rng(seed)

        def sample(self) -> np.ndarray:
            """A point of the box: uniform along bounded axes, normal along others."""
            bounded = np.isfinite(self.low) & np.isfinite(self.high)
            low, high = np.where(bounded, self.low, 0), np.where(bounded, self.high, 1)
            drawn = np.where(bounded, self._random.uniform(low, high), self._random.normal(size=self.shape))
            return np.clip(drawn, self.low, self.high).astype(self.dtype)

        def contains(self, x: Any) -> bool:
            """Whether x has the shape of the box and lies in it."""
            x = np.asarray(x)
            return x.shape == self.shape and bool(np.all((x >= self.low) & (x <= self.high)))

        def __contains__(self, x: Any) -> bool:
            return self.contains(x)


Reward = Callable[[PlantState, PlantState], float]


class Environment(_Base):
    """A robot whose masses an agent accelerates, with Gymnasium's interface; a gymnasium.Env where that is installed.

    action       (n,) accelerations of the masses along their rails, -1 to 1 of the motor's `max_acceleration`. They are held
                 for `period_s`; where a mass would leave its rail or pass its motor's greatest rate, it is slowed to that.
    observation  (13 + 2 n,) attitude w x y z; angular velocity, rad/s, body frame (3); place of the geometric centre less
                 the goal, m (2); its velocity, m/s (2); N over the weight; f_s / N, at most 10; then rail coordinates (n) and
                 rates (n)
    reward       reward(before, after) of two PlantStates; default: by how many radii the ball has come nearer to the goal
    terminated   rolling is over: the ball slips or leaves the floor. The reward is then less by 1
    truncated    the scenario's duration is over

    The masses are ideal, exactly where they are commanded, and there is no controller: the agent is it. `goal`, m: default
    that of the scenario's [task], else the origin.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}
    spec = None

    def __init__(self, scenario, *, period_s: float = 0.02, goal=None, reward: Reward | None = None,
                 render_mode: str | None = None):
        """`scenario`: a Scenario, or what Scenario() takes. Raises ScenarioError, and ValueError for other arguments."""
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode: {render_mode} is unknown; allowed: None, rgb_array")
        if not 0 < period_s < np.inf:
            raise ValueError(f"period_s: {period_s} is out of range; allowed: a finite number > 0")
        self._scenario = as_scenario(scenario).copy()
        self._scenario.set("run.actuation", "ideal").set("run.on_violation", "stop")
        self.period_s, self.render_mode, self._reward = float(period_s), render_mode, reward
        self._start(self._scenario)
        self.goal = np.array(self._goal_of(goal), dtype=float)
        if self.goal.shape != (2,) or not np.isfinite(self.goal).all():
            raise ValueError(f"goal: {goal} is not allowed; allowed: two finite numbers, m")
        self._radius_m = float(self._scenario["ball.radius"])
        n = self._plant.mass_count
        self.action_space = Box(-np.ones(n), np.ones(n), dtype=np.float64)
        bound = np.concatenate([np.ones(4), np.full(9, np.inf), np.full(2 * n, np.inf)])
        bound[12] = 10
        low = -bound
        low[12] = 0
        self.observation_space = Box(low, bound, dtype=np.float64)

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None):
        """Puts the ball back to the scenario's start. Returns (observation, info).

        seed     of the action space's samples and, with Gymnasium, of `np_random`; the plant itself has no chance
        options  {"set": {key: value}} changes keys of the scenario for this episode, as the place of the start or the floor
        """
        if _Base is not object:
            super().reset(seed=seed)
        if seed is not None:
            self.action_space.seed(seed)
        if not isinstance(options, (Mapping, type(None))):
            raise TypeError(f"options: {type(options).__name__} is not allowed; allowed: a dict")
        changes = dict((options or {}).get("set", {}))
        scenario = self._scenario.copy()
        for key, value in changes.items():
            scenario.set(key, value)
        self._start(scenario)
        return self._observation(), self._info()

    def step(self, action):
        """Accelerates the masses for one period. Returns (observation, reward, terminated, truncated, info).

        Raises ValueError for an action of the wrong shape or with numbers that are not finite.
        """
        action = np.asarray(action, dtype=float)
        if action.shape != self.action_space.shape or not np.isfinite(action).all():
            raise ValueError(f"action: {action.tolist()} is not allowed; allowed: {self.action_space.shape[0]} finite numbers")
        before = self._state
        position, velocity = self._commanded(before, np.clip(action, -1, 1))
        if not self._over():
            self._state = self._plant.advance(self.period_s, position=position, velocity=velocity)
            self._path.append(self._state.position_W_m[:2])
        if self._reward is not None:
            reward = float(self._reward(before, self._state))
        else:
            reward = (self._distance_m(before) - self._distance_m(self._state)) / self._radius_m
        terminated = self._state.end != ""
        truncated = not terminated and self._time_is_over
        return self._observation(), reward - terminated, terminated, truncated, self._info()

    def render(self):
        """The path from above, the ball, the goal and f_s / N, as an (h, w, 3) array of uint8; None without render_mode."""
        if self.render_mode is None:
            return None
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from matplotlib.patches import Circle
        figure = Figure(figsize=(4, 4), dpi=80, layout="constrained")
        canvas, axes = FigureCanvasAgg(figure), figure.add_subplot()
        path = np.array(self._path)
        axes.plot(path[:, 0], path[:, 1])
        axes.add_patch(Circle(path[-1], self._radius_m, fill=False))
        axes.plot(*self.goal, marker="x")
        axes.set(aspect="equal", xlabel="$z_1$ [m]", ylabel="$z_2$ [m]",
                 title=f"t = {self._state.time_s:.2f} s, $f_s/N$ = {self._state.mu_required:.3f}")
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()

    def close(self) -> None:
        """Does nothing: there is nothing to close."""

    @property
    def unwrapped(self) -> Environment:
        """The environment itself."""
        return self

    @property
    def state(self) -> PlantState:
        """The plant now."""
        return self._state

    def _start(self, scenario: Scenario):
        checked = scenario.checked()
        self._plant = Plant(scenario)
        self._duration_s = checked.duration_s
        self._most = np.array(checked.max_acceleration)
        self._fastest = np.array(checked.max_rate)
        self._ends = np.array(checked.rail_ends).reshape(-1, 2)
        self._weight_n = checked.weight_n
        self._state = self._plant.state
        self._path = [self._state.position_W_m[:2]]

    def _goal_of(self, goal):
        if goal is not None:
            return goal
        try:
            return self._scenario["task.goal"]
        except KeyError:
            return (0.0, 0.0)

    def _commanded(self, state, action):
        """(position, velocity) at the end of the period."""
        h, rate = self.period_s, state.mass_velocity
        faster = np.clip(rate + h * action * self._most, -self._fastest, self._fastest)
        position = state.mass_position + h / 2 * (rate + faster)
        low, high = self._ends.T
        inside = np.clip(position, low, high)
        return inside, np.where(inside == position, faster, 0.0)

    @property
    def _time_is_over(self):
        return self._state.time_s >= self._duration_s * (1 - 1e-9)  # sums of period_s round

    def _over(self):
        return self._state.end != "" or self._time_is_over

    def _distance_m(self, state):
        return float(np.linalg.norm(state.position_W_m[:2] - self.goal))

    def _observation(self):
        s = self._state
        load = s.normal_force_n / self._weight_n if self._weight_n > 0 else 0.0
        return np.concatenate([s.orientation, s.angular_velocity_B_radps, s.position_W_m[:2] - self.goal, s.velocity_W_mps[:2],
                               [load, min(s.mu_required, 10.0)], s.mass_position, s.mass_velocity])

    def _info(self):
        return {"time_s": self._state.time_s, "distance_m": self._distance_m(self._state), "end": self._state.end,
                "mu_required_max": self._state.mu_required_max, "normal_force_min_n": self._state.normal_force_min_n}
