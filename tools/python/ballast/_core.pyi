"""The part of the package in C++. Use the package, which documents what these do."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

version: str
programs: str     # the folder of ballast
most_steps: int   # of one motor in one Plant.advance()

class CheckedScenario:
    name: str
    toml: str
    id: int
    duration_s: float
    control_period_s: float
    actuation: str
    mass_count: int
    weight_n: float
    max_acceleration: list[float]  # of the motors, rail units / s^2
    max_rate: list[float]          # rail units / s
    rail_ends: list[tuple[float, float]]
    warnings: list[tuple[str, str]]  # (key, text)

def find_scenario(name_or_path: str) -> str: ...
def check_file(file: str, overrides: Sequence[str], faults: Sequence[str]) -> CheckedScenario: ...
def check_text(toml: str, source: str, overrides: Sequence[str], faults: Sequence[str]) -> CheckedScenario: ...
def changed_toml(toml: str, source: str, overrides: Sequence[str], faults: Sequence[str]) -> str: ...
def friction(scenario: CheckedScenario) -> str: ...
def run(scenario: CheckedScenario, folder: str, no_log: bool, speed: float) -> tuple[int, list[str]]: ...

class Ball:
    radius_m: float
    gravity_mps2: float
    shell_mass_kg: float
    inertia_kgm2: tuple[float, float, float]  # principal, about the shell's own centre of mass
    center_of_mass_B_m: tuple[float, float, float]  # of the shell, from the geometric centre
    mass_count: int
    mass_kg: tuple[float, ...]
    def __init__(self, scenario: CheckedScenario, believed: bool) -> None: ...
    def rail(self, mass: int, theta: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...

# (values, derivatives) with jac, the values alone without.
def rolling_forces(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike, thetaddot: ArrayLike,
                   jac: bool) -> tuple: ...
def detached_motion(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike, thetaddot: ArrayLike,
                    jac: bool) -> tuple: ...
def rolling_disk_forces(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                        thetaddot: ArrayLike, jac: bool) -> tuple: ...
def detached_disk_motion(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                         thetaddot: ArrayLike, jac: bool) -> tuple: ...

class Plant:
    actuation: str
    mass_count: int
    def __init__(self, scenario: CheckedScenario) -> None: ...
    def advance(self, dt_s: float, steps: Sequence[int], position: Sequence[float], velocity: Sequence[float]) -> None: ...
    def copy(self) -> Plant: ...
    def state(self) -> dict[str, Any]: ...

def sweep_columns(file: str) -> list[tuple[str, str]]: ...  # (name, meaning)
def sweep_column(file: str, name: str) -> np.ndarray | list[str]: ...
