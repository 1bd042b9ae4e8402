"""The plant stepped by hand."""
import threading
import unittest

import ballast
import numpy as np


class Values(unittest.TestCase):
    def test_prescribed_it_is_the_plant_of_a_run(self):
        """With no controller the plant alone makes the run, so tick by tick its states are the run's, bit for bit."""
        scenario = ballast.Scenario("paper_ball", set={"duration": 0.5, "run.actuation": "prescribed"})
        run, plant = ballast.run(scenario), ballast.Plant(scenario)
        state, contact = run.channels["plant_state"], run.channels["contact"]
        for k in range(1, 501):
            now = plant.advance(k * 0.001 - plant.state.time_s)
            if k % 100 == 0:
                np.testing.assert_array_equal(now.position_W_m, state.position_W_m[k])
                np.testing.assert_array_equal(now.orientation, state.orientation[k])
                self.assertEqual(now.normal_force_n, contact.normal_force_n[k])
        self.assertEqual(plant.actuation, "prescribed")

    def test_steps_move_a_mass(self):
        """A motor follows 20 microsteps, one per 50 ms, to within a full step, the most that a rotor lags its field."""
        scenario = ballast.Scenario("desk_ball")
        plant = ballast.Plant(scenario)
        motor = scenario.to_dict()["mass"][0]["motor"]
        full_step = 2 * np.pi / (200 * motor["gear_ratio"])  # of the rail; a NEMA 17 has 200 a turn
        start = plant.state.mass_position
        for _ in range(20):
            now = plant.advance(0.05, steps=[1, 0, 0])
        self.assertEqual(now.end, "")
        self.assertLess(abs(now.mass_position[0] - start[0] - 20 / motor["microsteps"] * full_step), full_step)
        self.assertGreater(abs(now.mass_position[0] - start[0]), 0.25 * full_step)
        self.assertAlmostEqual(now.time_s, 1.0, places=12)

    def test_ideal_masses_are_led(self):
        plant = ballast.Plant(ballast.Scenario("paper_ball").set("run.actuation", "ideal"))
        target = plant.state.mass_position + 1e-4  # gently: the ball is to roll on
        now = plant.advance(0.1, position=target)
        # Coordinates of 2 rad round by 4e-16, and rates over 0.1 s by ten times that; room for some 20 such.
        np.testing.assert_allclose(now.mass_position, target, atol=1e-13, rtol=0)
        np.testing.assert_allclose(now.mass_velocity, 0, atol=1e-13)

    def test_the_physics_ends(self):
        plant = ballast.Plant(ballast.Scenario("paper_ball", set={"surface.static_friction": 0.01, "run.actuation": "prescribed",
                                                                  "run.on_violation": "stop"}))
        end = plant.advance(20.0)
        self.assertEqual(end.end, "slipped")
        self.assertEqual(plant.advance(1.0).time_s, end.time_s)


class Nonsense(unittest.TestCase):
    def test_values(self):
        plant = ballast.Plant("paper_ball")
        n, before = plant.mass_count, plant.state
        for arguments, keys, kind in (((0.0,), {}, ValueError), ((-1.0,), {}, ValueError), ((float("nan"),), {}, ValueError),
                                      (("x",), {}, ValueError), ((None,), {}, TypeError), ((0.1, [1]), {}, ValueError),
                                      ((0.1, [0.5] * n), {}, TypeError), ((0.1, "ab"), {}, TypeError),
                                      ((0.1, [10**6] * n), {}, ValueError), ((1e300,), {}, ValueError),
                                      ((0.1, np.full(n, 2**64 - 1, dtype=np.uint64)), {}, ValueError), ((0.1, [[1] * n]), {}, ValueError),
                                      ((0.1, [2**63] * n), {}, (ValueError, TypeError)),
                                      ((0.1,), {"position": [0.0] * n}, ValueError), ((0.1,), {"velocity": [0.0] * n}, ValueError)):
            with self.subTest(arguments=arguments, keys=keys), self.assertRaises(kind):
                plant.advance(*arguments, **keys)
        self.assertEqual(plant.state.time_s, before.time_s)
        ideal = ballast.Plant(ballast.Scenario("paper_ball").set("run.actuation", "ideal"))
        for value in ([float("nan")] * n, [0.0] * (n + 1), 1.0, ["a"] * n):
            with self.subTest(value=value), self.assertRaises((ValueError, TypeError)):
                ideal.advance(0.1, position=value)
        with self.assertRaises(ValueError):
            ideal.advance(0.1, velocity=[0.0] * n)
        with self.assertRaises(ballast.ScenarioError):
            ballast.Plant({"duration": 1.0})

    def test_threads_share_a_plant(self):
        plant = ballast.Plant("desk_ball")

        def advance():
            for _ in range(50):
                plant.advance(0.001, steps=[0, 0, 0])

        threads = [threading.Thread(target=advance) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertAlmostEqual(plant.state.time_s, 0.2, places=9)


if __name__ == "__main__":
    unittest.main()
