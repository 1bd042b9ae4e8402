"""ballast compare: what it says differs is what was made to differ, and nothing else."""

import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import ballast

import compare
import differences
from differences import MISSING
from synthetic_run import ball, event


class DifferencesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.a, self.b = Path(folder.name) / "a", Path(folder.name) / "b"

    def change(self, run, channel, tick, edit):
        """Applies `edit` to the decoded message of that tick and puts it back."""
        message_class = {"BALLAST_CONTACT": ballast.contact_t, "BALLAST_PLANT_STATE": ballast.plant_state_t}[channel]
        for number, data in enumerate(run.events):
            head = 28 + len(channel)
            if data[28:head] != channel.encode():
                continue
            message = message_class.decode(data[head:])
            if message.tick == tick:
                edit(message)
                run.events[number] = event(number, message.utime, channel, message.encode())
                return
        self.fail(f"no message of tick {tick}")

    def test_identical_runs(self):
        run = ball(controller=True)
        run.write(self.a)
        run.summary["wall_time"] = 12.5  # of the fields that always differ
        run.write(self.b)
        found = compare.Comparison(self.a, self.b)
        self.assertTrue(found.identical)
        self.assertIn("identical", compare.terminal_text(found))

    def test_distances_in_ulps_and_units(self):
        import math
        for a, b, steps in ((1.0, math.nextafter(1.0, 2), 1), (1.0, math.nextafter(1.0, 0), 1), (0.0, -0.0, 0),
                            (5e-324, -5e-324, 2), (1.0, 2.0, 2**52), (-1.0, -2.0, 2**52)):
            self.assertEqual(differences.ulps(a, b), steps)
            self.assertEqual(differences.ulps(b, a), steps)
        for value in (1, math.nan, math.inf, None):
            self.assertIsNone(differences.ulps(value, 1.0))
        for channel, field, unit in (("BALLAST_CONTROLLER_STATUS", "normal_force_n", "N"),
                                     ("BALLAST_CONTROLLER_STATUS", "commanded_position[3]",
                                      "rad on circles, m elsewhere"),
                                     ("BALLAST_CONTROLLER_STATUS", "mode", ""),
                                     ("BALLAST_STEP_COMMAND", "steps[0]", "microsteps"),
                                     ("BALLAST_STEP_COMMAND", "position_steps[0]", "microsteps")):
            self.assertEqual(differences.unit_of(channel, field), unit)
        self.assertEqual(differences.how_far("BALLAST_CONTACT", "normal_force_n", 4.0, math.nextafter(4.0, 5)),
                         " (1 ULP)")

    def test_first_tick_and_field(self):
        ball().write(self.a)
        changed = ball()

        def edit(message):
            rows = [list(row) for row in message.mass_position_B_m]
            rows[1][2] += 1e-15
            message.mass_position_B_m = rows
            message.lost_steps = [4, *message.lost_steps[1:]]

        self.change(changed, "BALLAST_PLANT_STATE", 57, edit)
        self.change(changed, "BALLAST_PLANT_STATE", 90, lambda message: setattr(message, "last", 1))
        changed.write(self.b)
        _, logs = differences.log_differences(self.a / "run.lcmlog", self.b / "run.lcmlog")
        contact, state = logs
        self.assertFalse(contact.differs)
        self.assertEqual((state.tick, state.field, state.differing), (57, "mass_position_B_m[1][2]", 2))
        self.assertNotEqual(state.a, state.b)

    def test_the_number_of_the_run_is_not_compared(self):
        ball().write(self.a)
        on_a_bus = ball()
        for tick in range(3):
            self.change(on_a_bus, "BALLAST_PLANT_STATE", tick, lambda message: setattr(message, "run_id", 77))
        on_a_bus.write(self.b)
        found = compare.Comparison(self.a, self.b)
        self.assertTrue(found.identical)
        self.assertIn("but its run_id", compare.terminal_text(found))
        # Beside it, what does differ is still found, and is what is named.
        self.change(on_a_bus, "BALLAST_PLANT_STATE", 2, lambda message: setattr(message, "last", 1))
        on_a_bus.write(self.b)
        found = compare.Comparison(self.a, self.b)
        state = next(log for log in found.logs if log.channel == "BALLAST_PLANT_STATE")
        self.assertEqual((state.tick, state.field, state.differing), (2, "last", 1))
        self.assertIn("without run_id", compare.terminal_text(found))
        self.assertIn("without run_id", compare._tables(found))

    def test_a_longer_log(self):
        ball().write(self.a)
        longer = ball()
        longer.events = longer.events[:-2]
        longer.write(self.b)
        _, logs = differences.log_differences(self.a / "run.lcmlog", self.b / "run.lcmlog")
        self.assertEqual([(log.tick, log.field, log.a, log.b) for log in logs], [(200, "", "a message", "none")] * 2)

    def test_fields_of_summaries(self):
        a = {"end": {"time": 2.0}, "trip": None, "list": [1, 2], "same": "x", "speed": 3, "holds": True}
        b = {"end": {"time": 2.5}, "trip": {"tick": 7}, "list": [1, 2, 3], "same": "x", "speed": 4, "holds": False}
        found = {d.path: (d.a, d.b, d.difference) for d in differences.summary_differences(a, b)}
        self.assertEqual(found, {"end.time": (2.0, 2.5, 0.5), "trip.tick": (MISSING, 7, None),
                                 "list.2": (MISSING, 3, None), "holds": (True, False, None)})
        self.assertEqual(differences.summary_differences(a, a), [])

    def test_rails_are_one_difference(self):
        rail = {"shape": "circle", "closed": True, "points": [[0, 0, 1], [0, 1, 0]]}
        a = {"masses": [{"mass": 1, "rail": rail}]}
        b = {"masses": [{"mass": 2, "rail": {**rail, "points": [[0, 0, 2], [0, 2, 0]]}}]}
        self.assertEqual([d.path for d in differences.robot_differences(a, b)], ["masses.0.mass", "masses.0.rail"])

    def test_the_program(self):
        for out, more in ((self.a, []), (self.b, ["--set", "mass.0.mass=1.25"])):
            subprocess.run([os.environ["BALLAST"], "run", "paper_ball", "--set", "duration=0.5", *more, "--out", out,
                            "--quiet"], check=True)
        done = subprocess.run([os.environ["BALLAST"], "compare", self.a, self.b], capture_output=True, text=True,
                              check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"masses\.0\.mass +1 +1\.25 +\+0\.25")
        self.assertRegex(done.stdout, r"mu_required\.max +0\.128 +0\.16 +\+0\.03")
        # From the first tick on, which is the countdown's: a ball of 4 kg at g = 1, and one with a quarter kg more out
        # of balance.
        self.assertRegex(done.stdout, r"first differ in tick -2: BALLAST_CONTACT, normal_force_n: 4 in A, 4\.2\d+ in B")
        self.assertIn(f"{self.b}/compare.html", done.stdout)
        self.assertTrue((self.b / "compare.html").exists())
        missing = subprocess.run([os.environ["BALLAST"], "compare", self.a, self.a / "none"], capture_output=True,
                                 text=True, check=False)
        self.assertEqual(missing.returncode, 2)
        self.assertIn("no such file or folder", missing.stderr)


if __name__ == "__main__":
    unittest.main()
