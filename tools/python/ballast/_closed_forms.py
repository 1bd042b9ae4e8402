"""The paper's closed forms over arrays.

Every function takes one state, or many: each argument is an array with its row in the last axis, and the axes before it
are broadcast as NumPy does it. Wrong shapes, numbers that are not finite and attitudes that are no unit quaternions raise
ValueError; arrays of anything but real numbers raise TypeError. The code is the firmware's own (firmware/model) or extends
it (sim/closed_forms), so the plant, a second derivation, agrees to rounding and integration error only.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._scenario import as_scenario


class RailPoint(NamedTuple):
    """A mass's place on its rail, from the geometric centre, and its derivatives by theta; each (..., 3), body frame."""

    position_B_m: np.ndarray  # zeta
    d1_B: np.ndarray          # zeta'
    d2_B: np.ndarray          # zeta''


class RollingForces(NamedTuple):
    """A ball that rolls without slipping."""

    angular_acceleration_B_radps2: np.ndarray  # (..., 3) Omegadot
    normal_force_n: np.ndarray                 # (...) N, positive upward; below 0 the ball would leave the floor
    friction_force_W_n: np.ndarray             # (..., 2) of the floor on the ball, -f_s sigma
    static_friction_n: np.ndarray              # (...) f_s >= 0

    @property
    def mu_required(self) -> np.ndarray:
        """f_s / N (...): what the floor's mu_s must be at least; inf where N <= 0."""
        normal = np.asarray(self.normal_force_n)
        return np.divide(self.static_friction_n, normal, out=np.full(normal.shape, np.inf), where=normal > 0)


class RollingDiskForces(NamedTuple):
    """A disk that rolls without slipping."""

    angular_acceleration_radps2: np.ndarray  # (...) phiddot
    normal_force_n: np.ndarray               # (...) N, positive upward
    friction_force_W1_n: np.ndarray          # (...) of the floor on the disk along e1
    static_friction_n: np.ndarray            # (...) f_s >= 0


class DetachedMotion(NamedTuple):
    """A ball in the air."""

    angular_acceleration_B_radps2: np.ndarray  # (..., 3) Omegadot
    acceleration_W_mps2: np.ndarray            # (..., 3) of the geometric centre


class DetachedDiskMotion(NamedTuple):
    """A disk in the air."""

    angular_acceleration_radps2: np.ndarray  # (...) phiddot
    acceleration_W_mps2: np.ndarray          # (..., 3) of the geometric centre


class Ball(_core.Ball):
    """What the closed forms take of a robot: ball, masses, rails, gravity, floor. It does not change."""

    def __init__(self, scenario, *, believed: bool = False):
        """`scenario`: a Scenario, or what Scenario() takes. `believed`: the robot of [believed] in place of the true one.

        Raises ScenarioError for a bad scenario, and where a mass moves along a trajectory in place of a rail.
        """
        super().__init__(as_scenario(scenario).checked(), believed)

    def rail(self, mass: int, theta: ArrayLike) -> RailPoint:
        """The place of a mass, which counts from 0, at the rail coordinates theta (...): rad on circles, m elsewhere."""
        return RailPoint(*super().rail(mass, theta))

    def __repr__(self) -> str:
        return f"<ballast.Ball of radius {self.radius_m:g} m with {self.mass_count} masses>"


def rolling_forces(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                   thetaddot: ArrayLike) -> RollingForces:
    """Angular acceleration and contact force of a ball that rolls without slipping (eq_Om_1d, eq_normal_1d,
    eq_static_friction_1d).

    ball       Ball with n masses
    q          (..., 4) attitude, w x y z, body -> space, unit
    Omega      (..., 3) angular velocity, rad/s, body frame
    theta      (..., n) rail coordinates, rad on circles, m elsewhere
    thetadot   (..., n) their rates
    thetaddot  (..., n) those' rates

    On a floor that slopes or resists the terms of tools/docs/physics.md, "Real floors", are in; where no N balances the
    ball there, the row is NaN.
    """
    return RollingForces(*_core.rolling_forces(ball, q, Omega, theta, thetadot, thetaddot))


def detached_motion(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                    thetaddot: ArrayLike) -> DetachedMotion:
    """Motion of a ball in the air (eq_detach_ball_1d). Arguments as for rolling_forces()."""
    return DetachedMotion(*_core.detached_motion(ball, q, Omega, theta, thetadot, thetaddot))


def rolling_disk_forces(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                        thetaddot: ArrayLike) -> RollingDiskForces:
    """Angular acceleration and contact force of a disk that rolls without slipping (eq_ddphi_disk, eq_normal_disk,
    eq_static_friction_disk).

    ball       Ball whose rails, centre of mass and external force lie in the plane of body axes 1 and 3
    phi        (...) angle from e1 to E1, rad, counterclockwise seen along e2: phidot > 0 rolls towards -e1
    phidot     (...) its rate, rad/s
    theta, thetadot, thetaddot  as for rolling_forces()

    Raises ValueError for a ball that is no disk.
    """
    return RollingDiskForces(*_core.rolling_disk_forces(ball, phi, phidot, theta, thetadot, thetaddot))


def detached_disk_motion(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                         thetaddot: ArrayLike) -> DetachedDiskMotion:
    """Motion of a disk in the air (eq_detach_disk_1d). Arguments as for rolling_disk_forces()."""
    return DetachedDiskMotion(*_core.detached_disk_motion(ball, phi, phidot, theta, thetadot, thetaddot))
