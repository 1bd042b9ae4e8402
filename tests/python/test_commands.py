"""friction, integrate, plan and sweep: the results of the commands, and their words."""
import json
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import ballast

BALLAST = os.environ["BALLAST"]


class Commands(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def command(self, *arguments):
        done = subprocess.run([BALLAST, *map(str, arguments)], capture_output=True, text=True, check=False, cwd=self.folder)
        return done.returncode, done.stdout, done.stderr

    def test_friction_is_the_commands_page(self):
        _, page, _ = self.command("friction", "paper_ball", "--set", "duration=1")
        found = ballast.friction(ballast.Scenario("paper_ball").set("duration", 1))
        self.assertEqual(found["page"], page)
        self.assertIn(found["text"], page)
        self.assertAlmostEqual(sum(part["part"] for part in found["parts"]), 1, places=9)
        self.assertGreater(found["mu_required"]["max"], 0)

    def test_friction_refuses_faults_as_the_command_does(self):
        _, _, words = self.command("friction", "paper_ball", "--fault", "motor_stall@1:mass=0")
        with self.assertRaises(ballast.RunError) as caught:
            ballast.friction(ballast.Scenario("paper_ball", faults=["motor_stall@1:mass=0"]))
        self.assertEqual(words, f"ballast: {caught.exception}\n")

    def test_integrate(self):
        self.command("integrate", "paper_ball", "--out", "a", "--quiet", "--tolerance", "1e-8", "--set", "duration=2")
        found = ballast.integrate(ballast.Scenario("paper_ball").set("duration", 2), tolerance=1e-8, out=self.folder / "b")
        theirs = json.loads((self.folder / "a/summary.json").read_text())
        self.assertEqual(found["summary"]["final"], theirs["final"])
        self.assertTrue((self.folder / "b/integrators.json").exists())
        self.assertIn("summary", ballast.integrate("paper_ball", "rk4", step_s=0.01))
        with self.assertRaisesRegex(ballast.RunError, "did you mean|allowed: rk4"):
            ballast.integrate("paper_ball", "rk5")
        with self.assertRaisesRegex(ballast.RunError, "out of range"):
            ballast.integrate("paper_ball", tolerance=1.0)

    def test_plan(self):
        self.command("new", "desk", "--yes")
        task = ballast.Scenario(self.folder / "desk.toml")
        impossible = ballast.plan(task.copy().set("task.goal", [50.0, 0.0]), self.folder / "far.toml")
        self.assertEqual((impossible.found, impossible.file), (False, None))
        self.assertTrue(impossible.binding)
        with self.assertRaisesRegex(ballast.RunError, "no plan"):
            impossible.scenario
        near = ballast.plan(task.copy().set("task.goal", [0.2, 0.0]), self.folder / "near.toml", seed=1)
        self.assertTrue(near.found)
        self.assertEqual(near.claims, json.loads((self.folder / "near.json").read_text()))
        run = ballast.run(near.scenario, actuation="prescribed")
        # The claims were rolled by the plant with the same tolerance, in other steps.
        self.assertAlmostEqual(run.summary["mu_required"]["max"], near.claims["mu_required"]["max"], places=7)
        with self.assertRaises(ballast.RunError):
            ballast.plan("paper_ball", self.folder / "none.toml")  # has no [task]
        with self.assertRaisesRegex(ballast.RunError, "--out"):
            ballast.plan(task, self.folder / "far.json")

    def test_sweep(self):
        spec = {"scenario": "paper_ball", "runs": 6, "seed": 1, "name": "small",
                "set": {"run.actuation": "prescribed", "duration": 0.5}, "vary": {"mass.0.mass": {"normal": [1.0, 0.05]}}}
        done = ballast.sweep(spec, self.folder / "x", jobs=2)
        self.assertTrue(done.file.read_bytes().startswith(b"\x89HDF"))
        self.assertIn("6 runs of paper_ball", done.page)
        with self.assertRaisesRegex(ballast.RunError, "runs"):
            ballast.sweep({**spec, "runs": -1}, self.folder / "y")
        with self.assertRaises(TypeError):
            ballast.sweep({**spec, "runs": None}, self.folder / "y")


if __name__ == "__main__":
    unittest.main()
