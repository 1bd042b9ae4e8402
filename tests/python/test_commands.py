"""friction, integrate, plan and sweep: the results of the commands, and their words."""
import json
import os
import random
import subprocess
import tempfile
import unittest
from pathlib import Path

import ballast
import numpy as np

SEED = 24
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
        self.assertEqual(len(done), 6)
        with self.assertRaisesRegex(ballast.RunError, "runs"):
            ballast.sweep({**spec, "runs": -1}, self.folder / "y")
        with self.assertRaises(TypeError):
            ballast.sweep({**spec, "runs": None}, self.folder / "y")

    def test_the_columns_of_a_sweep_are_the_runs(self):
        """Grid values as written; kept values to the bit those of a run with the row's values, which `--row` runs again."""
        spec = {"scenario": "paper_ball", "runs": 2, "seed": 2**40 + 1, "name": "small",
                "set": {"run.actuation": "prescribed", "duration": 0.5},
                "vary": {"mass.0.mass": {"normal": [1.0, 0.05]}, "surface.static_friction": {"grid": [0.01, 0.35]}},
                "keep": {"values": ["mu_required.max", "end.reason", "final.position"]}}
        done = ballast.sweep(spec, self.folder / "x", jobs=1)
        columns = done.columns
        self.assertEqual(list(columns), ["row", "seed", "exit_status", "held", "mass_0_mass", "surface_static_friction",
                                         "mu_required_max", "end_reason", "final_position"])
        self.assertEqual(columns["row"].tolist(), [0, 1, 2, 3])
        self.assertEqual(columns["surface.static_friction"].tolist(), [0.01, 0.01, 0.35, 0.35])
        self.assertEqual(columns["end.reason"].tolist(), ["slipped", "slipped", "completed", "completed"])
        self.assertEqual(columns["held"].tolist(), [False, False, True, True])
        self.assertEqual(columns["exit_status"].tolist(), [3, 3, 0, 0])
        self.assertEqual(columns["final.position"].shape, (4, 3))
        self.assertEqual(columns["mu_required.max"][columns["held"]].shape, (2,))
        self.assertIn("mu_required.max", columns.meaning("mu_required.max"))
        again = ballast.run(ballast.Scenario("paper_ball", set={**spec["set"], "mass.0.mass": columns["mass.0.mass"][2],
                                                                "surface.static_friction": 0.35}))
        # The batch kernel that made the row agrees with the plant to this (tools/docs/sweep.md).
        self.assertAlmostEqual(columns["mu_required.max"][2], again.summary["mu_required"]["max"], delta=1e-6)
        np.testing.assert_allclose(columns["final.position"][2], again.summary["final"]["position"], atol=1e-6)
        loaded = ballast.Sweep.load(self.folder / "x")
        self.assertEqual(loaded.columns["seed"].tolist(), columns["seed"].tolist())
        with self.assertRaisesRegex(KeyError, "no such column; allowed: row"):
            columns["nonsense"]
        with self.assertRaises(ValueError):
            columns["row"][0] = 1  # read-only

    def test_results_that_are_damaged(self):
        """Cut off, overwritten or no NetCDF at all: a RunError or, where the damage lies beside what is read, the values."""
        done = ballast.sweep({"scenario": "paper_ball", "runs": 3, "name": "small",
                              "set": {"run.actuation": "prescribed", "duration": 0.1},
                              "vary": {"mass.0.mass": {"normal": [1.0, 0.05]}}}, self.folder / "x", jobs=1)
        whole = done.file.read_bytes()
        with self.assertRaisesRegex(ballast.RunError, "No such file"):
            ballast.Sweep.load(self.folder)
        refused = 0
        rng = random.Random(SEED)
        for trial in range(30):
            spoilt = bytearray(whole[:rng.randrange(len(whole))] if trial % 2 else whole)
            for _ in range(rng.randrange(1, 20)):
                if spoilt:
                    spoilt[rng.randrange(len(spoilt))] = rng.randrange(256)
            done.file.write_bytes(spoilt)
            try:
                for values in ballast.Sweep.load(self.folder / "x").columns.values():
                    self.assertEqual(len(values), 3)
            except (ballast.RunError, UnicodeDecodeError):
                refused += 1
        self.assertGreater(refused, 10, f"seed {SEED}")


if __name__ == "__main__":
    print(f"seed {SEED}")
    unittest.main()
