"""The robot and its floor as a drawing needs them, from robot.json and scenario.toml of a run's folder."""

import json
import math
import tomllib
from typing import NamedTuple

import numpy as np

from patches import FloorPatch, read_patches, static_friction_at
from planned import Planned, read_planned

_EARTH_MPS2 = 9.81  # stands in for no gravity, so that forces have a scale


class Rail(NamedTuple):
    points_B: np.ndarray  # (n, 3), m
    closed: bool


class DrawnRobot(NamedTuple):
    """Lengths in m. `slope` is (angle, downhill) of the floor in rad, as in physics.md."""

    radius: float
    weight_n: float
    masses: list[float]  # kg
    rails: list[Rail | None]  # None for a mass on a trajectory
    slope: tuple[float, float]
    static_friction: float  # of the floor between the patches; infinite: perfect
    patches: list[FloorPatch]
    planned: Planned | None

    def static_friction_at(self, place):
        """mu_s at a place (2,) of the floor."""
        return float(static_friction_at(self.patches, np.reshape(place, (1, 2)), self.static_friction)[0])


class NoRobot(Exception):
    """There is no usable description of the robot. The message names the file and the reason."""


def _rail(entry):
    return None if entry is None else Rail(np.array(entry["points"], dtype=float).reshape(-1, 3), bool(entry["closed"]))


def read_robot(folder):
    """The robot of the run in this folder. Raises NoRobot."""
    path = folder / "robot.json"
    try:
        robot = json.loads(path.read_text(encoding="utf-8"))
        radius, masses = float(robot["ball"]["radius"]), robot["masses"]
        mass_kg = [float(entry["mass"]) for entry in masses]
        gravity = float(robot["gravity"]) or _EARTH_MPS2
        weight_n = gravity * (float(robot["ball"]["mass"]) + sum(mass_kg))
        rails = [_rail(entry["rail"]) for entry in masses]
        numbers = [radius, weight_n, *mass_kg, *(value for rail in rails if rail for value in rail.points_B.flat)]
        if not (all(map(math.isfinite, numbers)) and radius > 0 and weight_n > 0):
            raise ValueError("a number is out of range")
        path = folder / "scenario.toml"
        surface = tomllib.loads(path.read_text(encoding="utf-8")).get("surface", {})
        slope = surface.get("slope", {})
        return DrawnRobot(radius, weight_n, mass_kg, rails,
                          (float(slope.get("angle", 0)), float(slope.get("downhill", 0))),
                          float(surface.get("static_friction", math.inf)), read_patches(folder), read_planned(folder))
    except OSError as error:
        raise NoRobot(f"{path}: {error.strerror}") from error
    except (KeyError, TypeError, ValueError, AttributeError) as error:  # the errors of json and tomllib are ValueErrors
        raise NoRobot(f"{path}: not what a run writes ({error!r})") from error
