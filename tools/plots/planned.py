"""What a plan wants of a run: the [task] and [plan] in scenario.toml beside the log."""

import tomllib

import numpy as np


class Planned:
    """Places in m, times in s. `path` has rows of time, place (2) and f_s/N as planned; it may have none."""

    def __init__(self, task, plan, ball_radius, static_friction, envelope_use):
        self.goal = np.array(task["goal"], dtype=float)
        self.at_rest = bool(task.get("at_rest", True))
        self.via = [(np.array(via["position"], dtype=float), via.get("time")) for via in task.get("via", [])]
        self.keep_out = [(np.array(circle["center"], dtype=float), float(circle["radius"]))
                         for circle in task.get("keep_out", [])]
        follow = task.get("follow")
        self.follow = None if follow is None else (np.array(follow["points"], dtype=float), float(follow["tolerance"]))
        self.path = np.array(plan.get("path", []), dtype=float).reshape(-1, 4)
        self.need = plan.get("mu_required")
        self.radius = ball_radius
        self.use = min(float(task.get("friction_use", 0.8)), envelope_use)
        self.friction_limit = None if static_friction is None else self.use * static_friction

    @property
    def duration(self):
        return float(self.path[-1, 0]) if len(self.path) else None

    def place_at(self, time):
        """(n, 2): the planned place at these times; where the plan has ended, its last."""
        return np.stack([np.interp(time, self.path[:, 0], self.path[:, 1 + j]) for j in range(2)], axis=1)

    def need_at(self, time):
        """The planned f_s/N at these times; NaN after the plan's end."""
        return np.interp(time, self.path[:, 0], self.path[:, 3], right=np.nan)


def read_planned(folder):
    """None where the run has no plan, or an unreadable one: then nothing is drawn of it."""
    try:
        scenario = tomllib.loads((folder / "scenario.toml").read_text(encoding="utf-8"))
        friction = scenario.get("surface", {}).get("static_friction")
        friction = float(friction) if isinstance(friction, (int, float)) and np.isfinite(friction) else None
        use = float(scenario.get("envelope", {}).get("friction_use", 1))
        return Planned(scenario["task"], scenario["plan"], float(scenario["ball"]["radius"]), friction, use)
    except (OSError, ValueError, KeyError, TypeError):  # tomllib's errors are ValueErrors
        return None
