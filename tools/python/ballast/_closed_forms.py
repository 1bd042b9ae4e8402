"""The paper's closed forms over arrays.

Every function takes one state, or many: each argument is an array with its row in the last axis, and the axes before it
are broadcast as NumPy does it. Wrong shapes, numbers that are not finite and attitudes that are no unit quaternions raise
ValueError; arrays of anything but real numbers raise TypeError. The code is the firmware's own (firmware/model) or extends
it (sim/closed_forms), so the plant, a second derivation, agrees to rounding and integration error only.

With jac=True a function returns (values, jacobian): the derivatives by every argument, exact to rounding. The jacobian has
a field per argument. Its arrays are those of the values with one more axis at the end, for the components of the argument:

    forces, by = ballast.rolling_forces(ball, q, Omega, theta, thetadot, thetaddot, jac=True)
    by.theta.normal_force_n    # (..., n): dN / dtheta_i
    by.q.friction_force_W_n    # (..., 2, 3)

An attitude is differentiated by a rotation vector phi of the ball, in rad and its body frame: q becomes q (1, phi / 2), and
the axis has 3 components. Where a spline has a knot, the derivative by theta is that of one side.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, overload

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


class RollingForcesDerivative(NamedTuple):
    """The derivative of RollingForces by one argument with k components, or 3 for an attitude."""

    angular_acceleration_B_radps2: np.ndarray  # (..., 3, k)
    normal_force_n: np.ndarray                 # (..., k)
    friction_force_W_n: np.ndarray             # (..., 2, k)
    static_friction_n: np.ndarray              # (..., k), NaN where f_s = 0, in which it has a kink
    mu_required: np.ndarray                    # (..., k), NaN there and where N <= 0


class RollingForcesJacobian(NamedTuple):
    """The derivatives of RollingForces."""

    q: RollingForcesDerivative          # k = 3: by a rotation of the ball in its body frame, rad
    Omega: RollingForcesDerivative      # k = 3
    theta: RollingForcesDerivative      # k = n
    thetadot: RollingForcesDerivative   # k = n
    thetaddot: RollingForcesDerivative  # k = n


class DetachedMotionJacobian(NamedTuple):
    """The derivatives of DetachedMotion, each with one more axis at the end, of k components."""

    q: DetachedMotion          # k = 3: by a rotation of the ball in its body frame, rad
    Omega: DetachedMotion      # k = 3
    theta: DetachedMotion      # k = n
    thetadot: DetachedMotion   # k = n
    thetaddot: DetachedMotion  # k = n


class RollingDiskForcesJacobian(NamedTuple):
    """The derivatives of RollingDiskForces. Those by theta, thetadot and thetaddot have one more axis at the end, of n
    components. That of f_s is NaN where f_s = 0."""

    phi: RollingDiskForces
    phidot: RollingDiskForces
    theta: RollingDiskForces
    thetadot: RollingDiskForces
    thetaddot: RollingDiskForces


class DetachedDiskMotionJacobian(NamedTuple):
    """The derivatives of DetachedDiskMotion. Those by theta, thetadot and thetaddot have one more axis at the end, of n
    components."""

    phi: DetachedDiskMotion
    phidot: DetachedDiskMotion
    theta: DetachedDiskMotion
    thetadot: DetachedDiskMotion
    thetaddot: DetachedDiskMotion


class Ball:
    """The robot's parameters in the closed forms: ball, masses, rails, gravity, floor. It does not change."""

    def __init__(self, scenario, *, believed: bool = False):
        """`scenario`: a Scenario, or what Scenario() takes. `believed`: the robot of [believed] in place of the true one.

        Raises ScenarioError for a bad scenario, and where a mass moves along a trajectory in place of a rail.
        """
        self._made_of = as_scenario(scenario).copy(), bool(believed)
        self._ball = _core.Ball(self._made_of[0].checked(), self._made_of[1])

    @property
    def radius_m(self) -> float:
        """r."""
        return self._ball.radius_m

    @property
    def gravity_mps2(self) -> float:
        """g."""
        return self._ball.gravity_mps2

    @property
    def shell_mass_kg(self) -> float:
        """m_0."""
        return self._ball.shell_mass_kg

    @property
    def inertia_kgm2(self) -> tuple[float, float, float]:
        """Principal moments of m_0 about its own centre of mass."""
        return self._ball.inertia_kgm2

    @property
    def center_of_mass_B_m(self) -> tuple[float, float, float]:
        """Centre of mass of m_0, from the geometric centre."""
        return self._ball.center_of_mass_B_m

    @property
    def mass_count(self) -> int:
        """n."""
        return self._ball.mass_count

    @property
    def mass_kg(self) -> tuple[float, ...]:
        """m_1 to m_n."""
        return self._ball.mass_kg

    def rail(self, mass: int, theta: ArrayLike) -> RailPoint:
        """The place of a mass, which counts from 0, at the rail coordinates theta (...): rad on circles, m elsewhere."""
        return RailPoint(*self._ball.rail(mass, theta))

    def __repr__(self) -> str:
        return f"<ballast.Ball of radius {self.radius_m:g} m with {self.mass_count} masses>"

    def __reduce__(self):
        return _ball_of, self._made_of


def _ball_of(scenario, believed):
    return Ball(scenario, believed=believed)


def _part_in_cpp(ball) -> _core.Ball:
    part = getattr(ball, "_ball", None) if isinstance(ball, Ball) else None
    if part is None:
        raise TypeError(f"ball: {type(ball).__name__} is not allowed; allowed: a ballast.Ball")
    return part


@overload
def rolling_forces(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                   thetaddot: ArrayLike, *, jac: Literal[False] = ...) -> RollingForces: ...


@overload
def rolling_forces(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                   thetaddot: ArrayLike, *, jac: Literal[True]) -> tuple[RollingForces, RollingForcesJacobian]: ...


def rolling_forces(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                   thetaddot: ArrayLike, *, jac: bool = False):
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

    jac        also return the exact derivatives, as (RollingForces, RollingForcesJacobian)
    """
    found = _core.rolling_forces(_part_in_cpp(ball), q, Omega, theta, thetadot, thetaddot, jac)
    if not jac:
        return RollingForces(*found)
    forces = RollingForces(*found[0])
    return forces, _by_argument(ball, RollingForcesJacobian, (3, 3), lambda *arrays: _with_mu(forces, *arrays), found[1])


@overload
def detached_motion(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                    thetaddot: ArrayLike, *, jac: Literal[False] = ...) -> DetachedMotion: ...


@overload
def detached_motion(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                    thetaddot: ArrayLike, *, jac: Literal[True]) -> tuple[DetachedMotion, DetachedMotionJacobian]: ...


def detached_motion(ball: Ball, q: ArrayLike, Omega: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                    thetaddot: ArrayLike, *, jac: bool = False):
    """Motion of a ball in the air (eq_detach_ball_1d). Arguments as for rolling_forces()."""
    found = _core.detached_motion(_part_in_cpp(ball), q, Omega, theta, thetadot, thetaddot, jac)
    if not jac:
        return DetachedMotion(*found)
    return DetachedMotion(*found[0]), _by_argument(ball, DetachedMotionJacobian, (3, 3), DetachedMotion, found[1])


@overload
def rolling_disk_forces(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                        thetaddot: ArrayLike, *, jac: Literal[False] = ...) -> RollingDiskForces: ...


@overload
def rolling_disk_forces(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                        thetaddot: ArrayLike, *,
                        jac: Literal[True]) -> tuple[RollingDiskForces, RollingDiskForcesJacobian]: ...


def rolling_disk_forces(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                        thetaddot: ArrayLike, *, jac: bool = False):
    """Angular acceleration and contact force of a disk that rolls without slipping (eq_ddphi_disk, eq_normal_disk,
    eq_static_friction_disk).

    ball       Ball whose rails, centre of mass and external force lie in the plane of body axes 1 and 3
    phi        (...) angle from e1 to E1, rad, counterclockwise seen along e2: phidot > 0 rolls towards -e1
    phidot     (...) its rate, rad/s
    theta, thetadot, thetaddot  as for rolling_forces()

    jac        also return the exact derivatives, as (RollingDiskForces, RollingDiskForcesJacobian)

    Raises ValueError for a ball that is no disk.
    """
    found = _core.rolling_disk_forces(_part_in_cpp(ball), phi, phidot, theta, thetadot, thetaddot, jac)
    if not jac:
        return RollingDiskForces(*found)
    by = _by_argument(ball, RollingDiskForcesJacobian, (None, None), RollingDiskForces, found[1])
    return RollingDiskForces(*found[0]), by


@overload
def detached_disk_motion(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                         thetaddot: ArrayLike, *, jac: Literal[False] = ...) -> DetachedDiskMotion: ...


@overload
def detached_disk_motion(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                         thetaddot: ArrayLike, *,
                         jac: Literal[True]) -> tuple[DetachedDiskMotion, DetachedDiskMotionJacobian]: ...


def detached_disk_motion(ball: Ball, phi: ArrayLike, phidot: ArrayLike, theta: ArrayLike, thetadot: ArrayLike,
                         thetaddot: ArrayLike, *, jac: bool = False):
    """Motion of a disk in the air (eq_detach_disk_1d). Arguments as for rolling_disk_forces()."""
    found = _core.detached_disk_motion(_part_in_cpp(ball), phi, phidot, theta, thetadot, thetaddot, jac)
    if not jac:
        return DetachedDiskMotion(*found)
    by = _by_argument(ball, DetachedDiskMotionJacobian, (None, None), DetachedDiskMotion, found[1])
    return DetachedDiskMotion(*found[0]), by


def _by_argument(ball, jacobian, own, kind, arrays):
    """The derivatives in columns, as a `jacobian` of views. `own`: columns of the first arguments; None: one, and no axis."""
    places, start = [], 0
    for count in (*own, *[ball.mass_count] * 3):
        places.append(start if count is None else slice(start, start + count))
        start += 1 if count is None else count
    return jacobian(*(kind(*(array[..., place] for array in arrays)) for place in places))


def _with_mu(forces, turning, normal, friction, size):
    """A RollingForcesDerivative with that of f_s / N, (d f_s - mu dN) / N."""
    pressing = np.where(np.asarray(forces.normal_force_n) > 0, forces.normal_force_n, np.nan)[..., None]
    mu = forces.static_friction_n[..., None] / pressing
    return RollingForcesDerivative(turning, normal, friction, size, (size - mu * normal) / pressing)
