"""The simulated ball, stepped by hand."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._scenario import as_scenario


_LONGEST_S = 1e9  # of one advance(); keeps the number of its control periods countable


class PlantState(NamedTuple):
    """The plant at one instant. n is the number of masses."""

    time_s: float
    regime: str                           # rolling, sliding or flight
    orientation: np.ndarray               # (4,) w x y z, body -> space
    angular_velocity_B_radps: np.ndarray  # (3,)
    position_W_m: np.ndarray              # (3,) of the geometric centre
    velocity_W_mps: np.ndarray            # (3,)
    mass_position: np.ndarray             # (n,) rail coordinates, rad on circles, m elsewhere
    mass_velocity: np.ndarray             # (n,) their rates
    normal_force_n: float                 # N, positive upward
    static_friction_n: float              # f_s; while sliding, the kinetic friction
    friction_force_W_n: np.ndarray        # (2,) of the floor on the ball
    floor_static_friction: float          # mu_s of the floor under the ball
    normal_force_min_n: float             # the least N since the last control period began
    mu_required_max: float                # the greatest f_s / N since then
    end: str                              # empty, or why the physics has ended: slipped, detached, inconsistent
    end_text: str                         # why it is inconsistent

    @property
    def mu_required(self) -> float:
        """f_s / N now; inf where N <= 0."""
        return self.static_friction_n / self.normal_force_n if self.normal_force_n > 0 else math.inf


class Plant:
    """The true ball of a scenario at t = 0, its masses moved by hand: no controller, no monitor.

        plant = ballast.Plant("paper_ball")
        plant.advance(0.001, steps=[3, 0, -1])       # actuation "stepper": microsteps per motor
        plant.state.normal_force_n

    With actuation "prescribed" the masses follow the scenario's `motion`, with "ideal" they go where advance() leads them.
    Physics: tools/docs/physics.md. Threads may share a plant.
    """

    def __init__(self, scenario):
        """`scenario`: a Scenario, or what Scenario() takes. Raises ScenarioError."""
        self._plant = _core.Plant(as_scenario(scenario).checked())

    def copy(self) -> Plant:
        """A plant of its own in the same state, as for trying out what might come. copy.copy() and copy.deepcopy() do this."""
        other = object.__new__(type(self))
        other._plant = self._plant.copy()  # pylint: disable=protected-access
        return other

    def __copy__(self) -> Plant:
        return self.copy()

    def __deepcopy__(self, _) -> Plant:
        return self.copy()

    def __repr__(self) -> str:
        state = self.state
        return f"<ballast.Plant with {self.mass_count} masses: {state.end or state.regime} at t = {state.time_s:g} s>"

    @property
    def actuation(self) -> str:
        """How the masses are moved: "stepper", "ideal" or "prescribed"."""
        return self._plant.actuation

    @property
    def mass_count(self) -> int:
        """n, the number of masses."""
        return self._plant.mass_count

    @property
    def state(self) -> PlantState:
        """The plant now."""
        return PlantState(**self._plant.state())

    def advance(self, dt_s: float, steps: ArrayLike | None = None, *, position: ArrayLike | None = None,
                velocity: ArrayLike | None = None) -> PlantState:
        """Integrates over dt_s > 0 seconds, or to where the physics ends, and returns the state there.

        steps      (n,) whole numbers, with actuation "stepper": microsteps of each motor, evenly spaced over dt_s
        position   (n,) with actuation "ideal": rail coordinates at the end of dt_s
        velocity   (n,) their rates there; default: 0

        Raises ValueError or TypeError for values that do not fit the plant, and changes nothing then. Ctrl-C ends it
        between two control periods, with KeyboardInterrupt.
        """
        dt_s = float(dt_s)
        if not 0 < dt_s <= _LONGEST_S:
            raise ValueError(f"dt_s: {dt_s} is out of range; allowed: a number > 0, at most {_LONGEST_S:g}")
        if steps is not None and self.actuation != "stepper":
            raise ValueError(f'steps: the masses are moved by actuation "{self.actuation}"; allowed: with "stepper"')
        if (position is not None or velocity is not None) and self.actuation != "ideal":
            raise ValueError(f'position: the masses are moved by actuation "{self.actuation}"; allowed: with "ideal"')
        if position is None and self.actuation == "ideal":
            raise ValueError("position: is missing; ideal masses go where they are led, with no motion of their own")
        counts = [] if steps is None else self._row("steps", steps, whole=True)
        if any(abs(count) > _core.most_steps for count in counts):
            raise ValueError(f"steps: {counts} are too many; allowed: at most {_core.most_steps} each")
        where = [] if position is None else self._row("position", position)
        rates = [] if position is None else self._row("velocity", np.zeros(self.mass_count) if velocity is None else velocity)
        self._plant.advance(dt_s, counts, where, rates)
        return self.state

    def _row(self, name, values, whole=False):
        """The values as a list of n numbers."""
        array = np.asarray(values)
        if not whole and array.dtype.kind == "f":
            array = array.astype(float)  # a long double may become infinite
        if array.dtype.kind not in ("iu" if whole else "iuf") and array.size > 0:
            raise TypeError(f"{name}: {array.dtype} is not allowed; allowed: {'whole' if whole else 'real'} numbers")
        if array.shape != (self.mass_count,):
            raise ValueError(f"{name}: shape {array.shape} is not allowed; allowed: ({self.mass_count},)")
        if not np.isfinite(array).all():
            raise ValueError(f"{name}: {array.tolist()} is not finite; allowed: finite numbers")
        return array.tolist() if whole else array.astype(float).tolist()
