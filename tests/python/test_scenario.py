"""Scenarios in Python: loading, changing, checking, and errors in the words of the command."""
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import ballast
import numpy as np

BALLAST = os.environ["BALLAST"]
MINIMAL = {"duration": 1.0, "gravity": 9.81, "ball": {"radius": 0.1, "mass": 1.0, "inertia": [0.004, 0.004, 0.004]},
           "run": {"actuation": "prescribed"}}


def words_of_check(*arguments):
    """The errors that `ballast check` prints."""
    done = subprocess.run([BALLAST, "check", *map(str, arguments)], capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


class Errors(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def same_words(self, scenario, *arguments):
        """Checks that the exception is what the command prints; returns it."""
        status, words = words_of_check(*arguments)
        self.assertEqual(status, 1)
        with self.assertRaises(ballast.ScenarioError) as caught:
            scenario.check()
        # The command adds a line where the file alone is valid.
        self.assertEqual([line for line in words.splitlines() if " is valid without " not in line],
                         str(caught.exception).splitlines())
        return caught.exception

    def test_a_file_with_several_errors(self):
        path = self.folder / "bad.toml"
        path.write_text("duration = -1.0\ngravity = 9.81\nballl = 3\n[ball]\nradius = 0.1\nmass = 'heavy'\n")
        error = self.same_words(ballast.Scenario(path), path)
        self.assertGreater(len(error.findings), 2)
        first = min(error.findings, key=lambda finding: finding.line or 99)
        self.assertEqual((first.file, first.line, first.key, first.value), (str(path), 1, "duration", "-1.0"))
        self.assertTrue(first.allowed)

    def test_a_key_that_is_set(self):
        for key, value, text in (("ball.radius", -1.0, "-1.0"), ("mass.1.mas", 2, "2"), ("mass.7.mass", 2.0, "2.0"),
                                 ("run.actuation", "stpper", "stpper"), ("ball.mass", "1 kg", "1 kg"),
                                 ("initial.orientation", [1.0, 1.0, 0, 0], "[1.0, 1.0, 0, 0]"),
                                 ("ball.mass", float("nan"), "nan"), ("ball.mass", 10**30, str(10**30)),
                                 ("surface", "", ""), ("a..b", 1, "1")):
            with self.subTest(key=key):
                self.same_words(ballast.Scenario("paper_ball").set(key, value), "paper_ball", "--set", f"{key}={text}")

    def test_a_fault(self):
        self.same_words(ballast.Scenario("paper_ball", faults=["motor_stal@1"]), "paper_ball", "--fault", "motor_stal@1")

    def test_a_name_of_nothing(self):
        _, words = words_of_check("paper_bal")
        with self.assertRaises(ballast.ScenarioError) as caught:
            ballast.Scenario("paper_bal")
        self.assertEqual(words, str(caught.exception) + "\n")
        self.assertIn("did you mean paper_ball?", str(caught.exception))

    def test_what_the_controller_refuses(self):
        status, words = words_of_check("slide_to_roll", "--set", "run.actuation=stepper", "--set", "control.tracking=true")
        self.assertEqual(status, 1)
        with self.assertRaises(ballast.ScenarioError) as caught:
            ballast.Scenario("slide_to_roll", set={"run.actuation": "stepper", "control.tracking": True}).check()
        # In the place of the program's name, that of the scenario.
        self.assertEqual(words.removeprefix("ballast: "), str(caught.exception).removeprefix("slide_to_roll: ") + "\n")

    def test_values_that_are_no_toml(self):
        scenario = ballast.Scenario("paper_ball")
        for value in (None, object(), 1j, {1: 2}, [1, None], b"x"):
            with self.subTest(value=value), self.assertRaises(TypeError):
                scenario.set("ball.mass", value)
        with self.assertRaises(ValueError):
            scenario.set("ball.mass=2", 1.0)
        with self.assertRaises(TypeError):
            scenario.set(3, 1.0)
        with self.assertRaises(TypeError):
            ballast.Scenario(3)
        endless = []
        endless.append(endless)
        with self.assertRaises(RecursionError):
            scenario.set("ball.mass", endless)

    def test_texts_of_all_kinds_arrive_or_are_refused(self):
        for text in ('"', "\\", "a\nb", "\x00", "\x7f", "true", " x ", "1.0", "{", "#", "é", "\U0001f600", "'''"):
            with self.subTest(text=text):
                scenario = ballast.Scenario("paper_ball").set("task_of_mine", text)
                with self.assertRaises(ballast.ScenarioError):
                    scenario.check()
                self.assertEqual(scenario["task_of_mine"], text)
        with self.assertRaises(UnicodeError):
            ballast.Scenario("paper_ball").set("name", "\ud800").check()


class Changes(unittest.TestCase):
    def test_a_set_key_is_the_commands(self):
        scenario = ballast.Scenario("paper_ball").set("mass.1.mass", 2.0)
        self.assertEqual(scenario["mass.1.mass"], 2.0)
        self.assertEqual(scenario["mass"][1]["mass"], 2.0)
        for key in ("mass.9.mass", "mass.-1.mass", "mass.+1.mass", "mass.1_0.mass"):
            with self.subTest(key), self.assertRaises(KeyError):
                scenario[key]
        self.assertNotEqual(scenario.fingerprint, ballast.Scenario("paper_ball").fingerprint)
        scenario["mass.1.mass"] = np.float64(1.0)
        scenario["initial.position"] = np.zeros(2)
        self.assertEqual(scenario.fingerprint, ballast.Scenario("paper_ball").fingerprint)

    def test_a_copy_is_its_own(self):
        scenario = ballast.Scenario("paper_ball")
        other = scenario.copy().set("duration", 3)
        self.assertEqual((scenario.duration_s, other.duration_s), (20.0, 3.0))

    def test_a_dict_goes_in_and_comes_out(self):
        for name in ("paper_ball", "desk_ball"):
            scenario = ballast.Scenario(name).set("surface.static_friction", 0.3)
            self.assertEqual(ballast.Scenario(scenario.to_dict()).fingerprint, scenario.fingerprint)
        self.assertEqual(ballast.Scenario(MINIMAL).mass_count, 0)
        with self.assertRaises(ballast.ScenarioError) as caught:
            ballast.Scenario({**MINIMAL, "duration": -1}).check()
        error = caught.exception
        self.assertEqual((error.file, error.line, error.key, error.value), ("dict", None, "duration", "-1"))

    def test_a_saved_scenario_is_equal(self):
        scenario = ballast.Scenario("paper_ball", set={"duration": 0.5})
        with tempfile.TemporaryDirectory() as folder:
            scenario.save(Path(folder) / "mine.toml")
            self.assertEqual(ballast.Scenario(Path(folder) / "mine.toml").fingerprint, scenario.fingerprint)


if __name__ == "__main__":
    unittest.main()
