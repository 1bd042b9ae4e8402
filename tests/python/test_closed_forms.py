"""The closed forms over arrays: against the plant, with NumPy's broadcasting, and with nonsense."""
import unittest

import ballast
import numpy as np

SEED = 24
# Two derivations of a force or an acceleration, relative to its terms: some 50, each rounded by 1e-16, are 5e-15; 20 times that.
ROUNDING = 1e-13


def states(rng, rows, masses):
    """(q, Omega, theta, thetadot, thetaddot) of random states."""
    q = rng.normal(size=(*rows, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return q, rng.normal(size=(*rows, 3)), *(rng.normal(size=(*rows, masses)) for _ in range(3))


def product(p, q):
    """The product of quaternions w, x, y, z: p (..., 4), q (4,)."""
    w, x, y, z = np.moveaxis(p, -1, 0)
    return np.stack([w * q[0] - x * q[1] - y * q[2] - z * q[3], w * q[1] + x * q[0] + y * q[3] - z * q[2],
                     w * q[2] - x * q[3] + y * q[0] + z * q[1], w * q[3] + x * q[2] - y * q[1] + z * q[0]], axis=-1)


class Values(unittest.TestCase):
    def test_a_ball_without_masses_on_its_own(self):
        """A homogeneous ball that rolls on a level floor keeps its rate, and N is its weight."""
        ball = ballast.Ball({"duration": 1.0, "gravity": 9.81, "ball": {"radius": 0.1, "mass": 2.0, "inertia": [0.01] * 3},
                             "run": {"actuation": "prescribed"}})
        forces = ballast.rolling_forces(ball, [1, 0, 0, 0], [1.0, 2.0, 3.0], [], [], [])
        np.testing.assert_array_equal(forces.angular_acceleration_B_radps2, np.zeros(3))
        self.assertEqual(forces.normal_force_n, 2.0 * 9.81)
        self.assertEqual(forces.static_friction_n, 0.0)
        self.assertEqual(forces.mu_required, 0.0)
        air = ballast.detached_motion(ball, [1, 0, 0, 0], [1.0, 2.0, 3.0], [], [], [])
        np.testing.assert_array_equal(air.acceleration_W_mps2, [0, 0, -9.81])

    def test_the_plants_forces(self):
        """Along a prescribed run the closed form gives the plant's N and f_s: two derivations in separate code.

        The log holds no rail accelerations, which here are those of `motion`: 0 after its end.
        """
        scenario = ballast.Scenario("paper_ball", set={"duration": 2.0, "run.actuation": "prescribed"})
        ends = [sum(piece["duration"] for piece in mass["motion"]) for mass in scenario.to_dict()["mass"]]
        run = ballast.run(scenario)
        contact, state = run.channels["contact"], run.channels["plant_state"]
        rows = state.time_s > max(ends)
        self.assertGreater(rows.sum(), 100)
        ball, n = ballast.Ball(scenario), scenario.mass_count
        forces = ballast.rolling_forces(ball, state.orientation[rows], state.angular_velocity_B_radps[rows],
                                        state.mass_position[rows, :n], state.mass_velocity[rows, :n], np.zeros(n))
        weight = ball.gravity_mps2 * (ball.shell_mass_kg + sum(ball.mass_kg))
        np.testing.assert_allclose(forces.normal_force_n, contact.normal_force_n[rows], atol=ROUNDING * weight, rtol=0)
        np.testing.assert_allclose(forces.static_friction_n, contact.static_friction_n[rows], atol=ROUNDING * weight, rtol=0)

    def test_rows_are_independent_and_broadcast(self):
        ball = ballast.Ball("paper_ball")
        rng = np.random.default_rng(SEED)
        q, omega, theta, rate, acceleration = states(rng, (5, 3), ball.mass_count)
        for form in (ballast.rolling_forces, ballast.detached_motion):
            whole = form(ball, q, omega, theta, rate, acceleration)
            one_by_one = [[form(ball, q[i, j], omega[i, j], theta[i, j], rate[i, j], acceleration[i, j]) for j in range(3)]
                          for i in range(5)]
            for field, values in enumerate(whole):
                np.testing.assert_array_equal(values, np.array([[row[field] for row in rows] for rows in one_by_one]))
            shared = form(ball, q[:, :1], omega[0], theta[0, 0], rate, acceleration)
            for field, values in enumerate(form(ball, *(np.broadcast_to(a, (5, 3, a.shape[-1])) for a in
                                                        (q[:, :1], omega[0], theta[0, 0], rate, acceleration)))):
                np.testing.assert_array_equal(values, shared[field])
            # Any strides, and integers.
            turned = form(ball, q[::-1], omega[::-1], theta[::-1], rate[::-1], acceleration[::-1])
            for field, values in enumerate(turned):
                np.testing.assert_array_equal(values, whole[field][::-1])
        self.assertEqual(ballast.rolling_forces(ball, *(a[:0] for a in (q, omega, theta, rate, acceleration))).normal_force_n.shape,
                         (0, 3))

    def test_the_disk_is_the_ball_in_its_plane(self):
        """phi is minus the angle about e2, and phidot minus the rate: sim/closed_forms/rolling_disk.h."""
        ball = ballast.Ball("paper_disk")
        rng = np.random.default_rng(SEED)
        phi, phidot = rng.normal(size=20), rng.normal(size=20)
        theta, rate, acceleration = (rng.normal(size=(20, ball.mass_count)) for _ in range(3))
        zero = np.zeros(20)
        q = np.stack([np.cos(phi / 2), zero, -np.sin(phi / 2), zero], axis=-1)
        omega = np.stack([zero, -phidot, zero], axis=-1)
        disk = ballast.rolling_disk_forces(ball, phi, phidot, theta, rate, acceleration)
        rolling = ballast.rolling_forces(ball, q, omega, theta, rate, acceleration)
        size = 1 + np.abs(rolling.normal_force_n)  # of the terms that cancel
        self.assertLess(np.max(np.abs(disk.normal_force_n - rolling.normal_force_n) / size), ROUNDING)
        self.assertLess(np.max(np.abs(disk.friction_force_W1_n - rolling.friction_force_W_n[:, 0]) / size), ROUNDING)
        air = ballast.detached_disk_motion(ball, phi, phidot, theta, rate, acceleration)
        ball_in_air = ballast.detached_motion(ball, q, omega, theta, rate, acceleration)
        size = 1 + np.abs(ball_in_air.acceleration_W_mps2)
        self.assertLess(np.max(np.abs(air.acceleration_W_mps2 - ball_in_air.acceleration_W_mps2) / size), ROUNDING)

    def test_a_rail(self):
        """On a circle about the geometric centre |zeta'| is the radius, and zeta'' = -zeta."""
        ball = ballast.Ball("paper_ball")
        point = ball.rail(0, np.linspace(-4, 4, 7).reshape(7, 1))
        self.assertEqual(point.position_B_m.shape, (7, 1, 3))
        # Lengths below 1 m: sine, cosine and their products round by 1e-16 each.
        np.testing.assert_allclose(point.d2_B, -point.position_B_m, atol=1e-15, rtol=0)
        # Squares, sums and roots round by 1e-16 each, some ten on either side.
        np.testing.assert_allclose(np.linalg.norm(point.d1_B, axis=-1), np.linalg.norm(point.position_B_m, axis=-1), rtol=1e-14)
        for mass in (-1, ball.mass_count, 10**6):
            with self.assertRaises(IndexError):
                ball.rail(mass, 0.0)


class Derivatives(unittest.TestCase):
    """jac=True against differences of the functions themselves."""

    STEP = 1e-3

    def differences(self, form, arguments, place, component):
        """The derivative of every array of form(*arguments) by a component of an argument, over five points: off by h^4 times
        a fifth derivative over 30, and by rounding, 1e-16 of the value over h."""
        def at(steps):
            moved = [np.array(argument) for argument in arguments]
            if place == 0 and moved[0].shape[-1:] == (4,) and component is not None:
                half = steps * self.STEP / 2
                turn = np.array([np.cos(half), *(np.sin(half) * np.eye(3)[component])])
                moved[0] = product(moved[0], turn)
            elif component is None:
                moved[place] = moved[place] + steps * self.STEP
            else:
                moved[place][..., component] += steps * self.STEP
            return [np.array(values) for values in form(*moved)]

        return [(8 * (b - c) - (a - d)) / (12 * self.STEP) for a, b, c, d in zip(at(2), at(1), at(-1), at(-2))]

    def compare(self, form, arguments):
        """Relative to the value and the derivative together; 1e-8 leaves a fifth derivative 3e5 times as large."""
        values, by = form(*arguments, jac=True)
        for field, value in enumerate(form(*arguments)):
            np.testing.assert_array_equal(values[field], value)  # to the bit
        for place, name in enumerate(by._fields):
            derivative = by[place]
            components = arguments[place].shape[-1] if place > 1 or arguments[0].shape[-1:] == (4,) else None
            if name == "q":
                components = 3
            for component in [None] if components is None else range(components):
                found = self.differences(form, arguments, place, component)
                for field, value in enumerate(values):
                    column = derivative[field] if component is None else derivative[field][..., component]
                    self.assertEqual(column.shape, value.shape)
                    size = np.abs(value).max() + np.abs(column).max()
                    error = np.abs(column - found[field]).max()
                    self.assertLess(error, 1e-8 * size, f"seed {SEED}: {values._fields[field]} by {name}[{component}]")

    def test_the_ball(self):
        rng = np.random.default_rng(SEED)
        floors = {"level": {}, "sloping": {"surface.slope": {"angle": 0.2, "downhill": 0.7}},
                  "resisting": {"surface.rolling_resistance": 0.01, "surface.spin_friction": 0.003, "surface.creep": 0.5}}
        for name, floor in floors.items():
            ball = ballast.Ball(ballast.Scenario("paper_ball", set=floor))
            arguments = states(rng, (10,), ball.mass_count)
            if name == "resisting":  # slow masses, so that the ball presses on the floor in every row
                arguments = (*arguments[:3], 0.1 * arguments[3], 0.1 * arguments[4])
            for form in (ballast.rolling_forces, ballast.detached_motion):
                with self.subTest(name, form=form.__name__):
                    self.compare(lambda *a, form=form, **k: form(ball, *a, **k), arguments)

    def test_the_disk(self):
        ball = ballast.Ball("paper_disk")
        rng = np.random.default_rng(SEED)
        arguments = [rng.normal(size=10), rng.normal(size=10), *(rng.normal(size=(10, ball.mass_count)) for _ in range(3))]
        for form in (ballast.rolling_disk_forces, ballast.detached_disk_motion):
            with self.subTest(form.__name__):
                self.compare(lambda *a, form=form, **k: form(ball, *a, **k), arguments)

    def test_the_friction_that_is_needed(self):
        """d(f_s / N), by the quotient's rule."""
        ball = ballast.Ball("paper_ball")
        arguments = states(np.random.default_rng(SEED), (4, 3), ball.mass_count)
        forces, by = ballast.rolling_forces(ball, *arguments, jac=True)
        self.assertEqual(by.theta.mu_required.shape, (4, 3, ball.mass_count))
        self.assertEqual(by.q.friction_force_W_n.shape, (4, 3, 2, 3))
        presses = forces.normal_force_n > 0
        self.assertTrue(presses.any() and not presses.all())
        self.assertTrue(np.isnan(by.theta.mu_required[~presses]).all())

        def mu(theta):
            return ballast.rolling_forces(ball, *arguments[:2], theta, *arguments[3:]).mu_required[presses]

        h = 1e-6  # off by h^2 and by 1e-16 / h
        step = h * np.eye(ball.mass_count)[0]
        difference = (mu(arguments[2] + step) - mu(arguments[2] - step)) / (2 * h)
        np.testing.assert_allclose(by.theta.mu_required[presses][:, 0], difference, rtol=1e-5, atol=1e-7)

    def test_one_state_and_none(self):
        ball = ballast.Ball("paper_ball")
        one = [np.array([1.0, 0, 0, 0]), np.zeros(3), *(np.zeros(ball.mass_count) for _ in range(3))]
        _, by = ballast.rolling_forces(ball, *one, jac=True)
        self.assertEqual(by.thetaddot.angular_acceleration_B_radps2.shape, (3, ball.mass_count))
        _, by = ballast.detached_motion(ball, np.zeros((0, 4)), *one[1:], jac=True)
        self.assertEqual(by.Omega.acceleration_W_mps2.shape, (0, 3, 3))
        alone = ballast.Ball({"duration": 1.0, "gravity": 9.81, "ball": {"radius": 0.1, "mass": 2.0, "inertia": [0.01] * 3},
                              "run": {"actuation": "prescribed"}})
        forces, by = ballast.rolling_forces(alone, [1, 0, 0, 0], [1.0, 2.0, 3.0], [], [], [], jac=True)
        self.assertEqual(by.theta.normal_force_n.shape, (0,))
        self.assertEqual(forces.static_friction_n, 0)
        self.assertTrue(np.isnan(by.q.static_friction_n).all())  # a kink
        np.testing.assert_array_equal(by.q.normal_force_n, 0)


class Nonsense(unittest.TestCase):
    def setUp(self):
        self.ball = ballast.Ball("paper_ball")
        self.good = [np.array([1.0, 0, 0, 0]), np.zeros(3), *(np.zeros(self.ball.mass_count) for _ in range(3))]

    def refused(self, kind, words, place, value):
        arguments = list(self.good)
        arguments[place] = value
        with self.assertRaisesRegex(kind, words):
            ballast.rolling_forces(self.ball, *arguments)

    def test_shapes(self):
        self.refused(ValueError, r"q: shape \(3\) is not allowed; allowed: \(\.\.\., 4\)", 0, np.zeros(3))
        self.refused(ValueError, r"Omega: shape \(\) is not", 1, 1.0)
        self.refused(ValueError, r"theta: shape \(9\) is not", 2, np.zeros(9))
        self.refused(ValueError, r"thetaddot: shape \(0\) is not", 4, [])
        arguments = [np.tile(a, (2 + (i == 3), 1)) for i, a in enumerate(self.good)]
        with self.assertRaisesRegex(ValueError, r"thetadot: its rows \(3\) do not broadcast with those of q, \(2\)"):
            ballast.rolling_forces(self.ball, *arguments)

    def test_kinds(self):
        for value in (None, "abc", object(), [1j, 0, 0], np.array(["a", "b", "c"]), {}, [True, False, True],
                      np.zeros(3, dtype="datetime64[s]"), np.array([None, None, None])):
            with self.subTest(value=value):
                self.refused(TypeError, "Omega", 1, value)
        self.refused((TypeError, ValueError), "", 1, [[1, 2, 3], [1, 2]])
        with self.assertRaises(TypeError):
            ballast.rolling_forces("paper_ball", *self.good)
        with self.assertRaises(TypeError):
            ballast.rolling_forces(None, *self.good)

    def test_numbers(self):
        for bad in (np.nan, np.inf):
            self.refused(ValueError, "Omega is not finite; allowed: finite numbers", 1, [0, bad, 0])
            many = np.zeros((2, 3, self.ball.mass_count))
            many[1, 2, 0] = bad
            self.refused(ValueError, "row 1, 2: theta is not finite", 2, many)
        self.refused(ValueError, "q is no unit quaternion", 0, [1.0, 0.1, 0, 0])
        self.refused(ValueError, "q is no unit quaternion", 0, np.zeros(4))

    def test_more_rows_than_any_memory(self):
        q = np.broadcast_to([1.0, 0, 0, 0], (2**50, 1, 4))
        theta = np.broadcast_to(0.0, (1, 2**50, self.ball.mass_count))
        for arguments in ((q, *self.good[1:]), (q, self.good[1], theta, *self.good[3:])):
            with self.assertRaises((MemoryError, ValueError)):
                ballast.rolling_forces(self.ball, *arguments)

    def test_a_ball_that_is_no_disk(self):
        with self.assertRaisesRegex(ValueError, "no disk: mass"):
            ballast.rolling_disk_forces(self.ball, 0.0, 0.0, *self.good[2:])

    def test_a_mass_without_a_rail(self):
        with self.assertRaisesRegex(ballast.ScenarioError, "trajectory"):
            ballast.Ball("tumbleweed")


if __name__ == "__main__":
    print(f"seed {SEED}")
    unittest.main()
