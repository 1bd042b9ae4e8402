"""The page of `ballast live`: one file, and what it is told of a run."""

import json
from pathlib import Path

from assemble import DRAWING_MODULES, described_patches, one_file, own_modules
from drawn_robot import read_robot

_PAGE = Path(__file__).resolve().parent / "page"
_LIVE_MODULES = ("main.js", "connection.js", "live_clock.js", "live_samples.js", "live_path.js", "controls.js", "readings.js",
                 "number_field.js", "pointing.js", "floor_gestures.js", "floor_marks.js", "stroke.js")


def page():
    """The page's bytes. Raises PackageError."""
    own = {**own_modules(*DRAWING_MODULES), **own_modules(*_LIVE_MODULES, folder=_PAGE)}
    style = (_PAGE / "live.css").read_text(encoding="utf-8")
    return one_file(_PAGE / "live.html", own, {}, style, connects="'self'").encode()


def described_run(folder, run):
    """What the page draws of a run: `run` is that of the event live.run; the folder has robot.json and scenario.toml.

    The keys are those that the replay of `ballast report` uses, and `plan`. Returns (a dict, the robot for Foxglove).
    Raises NoRobot.
    """
    robot = read_robot(folder)
    described = json.loads((folder / "robot.json").read_text(encoding="utf-8"))
    masses = [{**drawn, **limits} for drawn, limits in zip(described["masses"], run["masses"], strict=True)]
    planned = robot.planned
    perfect = robot.static_friction == float("inf")
    return {
        **run,
        "radius": robot.radius,
        "gravity": described.get("gravity"),
        "shell_mass": described["ball"].get("mass"),
        "masses": masses,
        "static_friction": None if perfect else robot.static_friction,
        "friction_known": True,
        "patches": described_patches(robot.patches),
        "plan": None if planned is None else {
            "path": planned.path[:, 1:3].tolist(),
            "goal": planned.goal.tolist(),
            "via": [place.tolist() for place, _ in planned.via],
        },
    }, robot
