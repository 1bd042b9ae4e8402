"""The environment after Gymnasium's interface. test_episodes.py has its random episodes."""
import unittest

import ballast
import numpy as np

SEED = 24


def desk(**keys):
    return ballast.Environment(ballast.Scenario("desk_ball", set={"duration": 2.0, **keys}), goal=(0.5, 0.0))


class Interface(unittest.TestCase):
    def test_signatures(self):
        env = desk()
        observation, info = env.reset(seed=SEED)
        self.assertIsInstance(info, dict)
        self.assertIn(observation, env.observation_space)
        self.assertEqual(observation.dtype, env.observation_space.dtype)
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
        self.assertIn(observation, env.observation_space)
        self.assertEqual((type(reward), type(terminated), type(truncated)), (float, bool, bool))
        self.assertIs(env.unwrapped, env)
        self.assertIsNone(env.render())
        env.close()

    def test_a_seed_repeats_an_episode(self):
        def episode():
            env = desk()
            env.reset(seed=SEED)
            return [env.step(env.action_space.sample())[0] for _ in range(20)]

        np.testing.assert_array_equal(episode(), episode())

    def test_rest_is_rest(self):
        """With no acceleration nothing moves from the scenario's rest until the duration ends the episode."""
        env = desk()
        start, _ = env.reset()
        for k in range(1, 101):
            observation, reward, terminated, truncated, _ = env.step(np.zeros(3))
            self.assertEqual((terminated, truncated), (False, k == 100))
        # An equilibrium to the rounding of the scenario's numbers.
        self.assertLess(np.abs(observation - start).max(), 1e-6)
        self.assertLess(abs(reward), 1e-6)

    def test_the_masses_do_what_the_action_says(self):
        env = desk()
        env.reset()
        before = env.state
        most = np.array(env._most)  # pylint: disable=protected-access
        env.step([0.1, -0.1, 0.05])
        after, h = env.state, env.period_s
        # Changes of 5e-3 and more in coordinates below 10, which round by 1e-15: 4e-13 of the change, and room for some 20 such.
        np.testing.assert_allclose(after.mass_velocity - before.mass_velocity, h * most * [0.1, -0.1, 0.05], rtol=1e-11)
        np.testing.assert_allclose(after.mass_position - before.mass_position, h**2 / 2 * most * [0.1, -0.1, 0.05], rtol=1e-11)

    def test_slip_ends_an_episode(self):
        env = desk(**{"surface.static_friction": 1e-3, "surface.kinetic_friction": 1e-3})
        env.reset()
        for _ in range(100):
            _, reward, terminated, _, info = env.step(np.ones(3))
            if terminated:
                break
        self.assertEqual(info["end"], "slipped")
        self.assertLess(reward, -0.9)
        time_s = env.state.time_s
        self.assertTrue(env.step(np.ones(3))[2])
        self.assertEqual(env.state.time_s, time_s)

    def test_options_change_the_episode(self):
        env = desk()
        observation, _ = env.reset(options={"set": {"initial.position": [0.2, 0.1]}})
        np.testing.assert_array_equal(observation[7:9], [-0.3, 0.1])
        with self.assertRaises(ballast.ScenarioError):
            env.reset(options={"set": {"ball.mass": -1}})
        observation, _ = env.reset()
        np.testing.assert_array_equal(observation[7:9], [-0.5, 0.0])

    def test_a_picture(self):
        env = ballast.Environment("desk_ball", render_mode="rgb_array")
        env.reset()
        env.step(np.zeros(3))
        picture = env.render()
        self.assertEqual((picture.dtype, picture.shape), (np.uint8, (320, 320, 3)))

    def test_nonsense(self):
        env = desk()
        env.reset()
        for action in (np.zeros(2), [np.nan] * 3, None, "abc", 1.0, [[0, 0, 0]]):
            with self.subTest(action=action), self.assertRaises((ValueError, TypeError)):
                env.step(action)
        for keys in ({"period_s": 0.0}, {"period_s": float("nan")}, {"goal": (1, 2, 3)}, {"goal": (np.nan, 0)},
                     {"render_mode": "human"}):
            with self.subTest(keys), self.assertRaises(ValueError):
                ballast.Environment("desk_ball", **keys)


if __name__ == "__main__":
    print(f"seed {SEED}")
    unittest.main()
