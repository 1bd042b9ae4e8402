"""The closed forms over arrays: against the plant, with NumPy's broadcasting, and with nonsense."""
import unittest

import ballast
import numpy as np

SEED = 24


def states(rng, rows, masses):
    """(q, Omega, theta, thetadot, thetaddot) of random states."""
    q = rng.normal(size=(*rows, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return q, rng.normal(size=(*rows, 3)), *(rng.normal(size=(*rows, masses)) for _ in range(3))


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
        weight = 9.81 * 10  # the bound on rounding is relative to about this; N is a sum of some 50 terms
        np.testing.assert_allclose(forces.normal_force_n, contact.normal_force_n[rows], atol=1e-13 * weight, rtol=1e-12)
        np.testing.assert_allclose(forces.static_friction_n, contact.static_friction_n[rows], atol=1e-13 * weight, rtol=1e-12)

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
        self.assertLess(np.max(np.abs(disk.normal_force_n - rolling.normal_force_n) / size), 1e-12)
        self.assertLess(np.max(np.abs(disk.friction_force_W1_n - rolling.friction_force_W_n[:, 0]) / size), 1e-12)
        air = ballast.detached_disk_motion(ball, phi, phidot, theta, rate, acceleration)
        ball_in_air = ballast.detached_motion(ball, q, omega, theta, rate, acceleration)
        np.testing.assert_allclose(air.acceleration_W_mps2, ball_in_air.acceleration_W_mps2, atol=1e-11, rtol=1e-11)

    def test_a_rail(self):
        """On a circle about the geometric centre |zeta'| is the radius, and zeta'' = -zeta."""
        ball = ballast.Ball("paper_ball")
        point = ball.rail(0, np.linspace(-4, 4, 7).reshape(7, 1))
        self.assertEqual(point.position_B_m.shape, (7, 1, 3))
        np.testing.assert_allclose(point.d2_B, -point.position_B_m, atol=1e-15)
        np.testing.assert_allclose(np.linalg.norm(point.d1_B, axis=-1), np.linalg.norm(point.position_B_m, axis=-1), rtol=1e-14)
        for mass in (-1, ball.mass_count, 10**6):
            with self.assertRaises(IndexError):
                ball.rail(mass, 0.0)


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

    def test_a_ball_that_is_no_disk(self):
        with self.assertRaisesRegex(ValueError, "no disk: mass"):
            ballast.rolling_disk_forces(self.ball, 0.0, 0.0, *self.good[2:])

    def test_a_mass_without_a_rail(self):
        with self.assertRaisesRegex(ballast.ScenarioError, "trajectory"):
            ballast.Ball("tumbleweed")


if __name__ == "__main__":
    print(f"seed {SEED}")
    unittest.main()
