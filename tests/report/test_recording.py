"""What the page is told of a run: samples as the log has them, and what takes the place of a missing summary."""

import base64
import contextlib
import gzip
import io
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import ballast
import numpy as np

import assemble
import compare
import recording
import report
import words
from event_log import LogError
from recording import Recording
from synthetic_run import BALL_RAILS, ball, detaching_ball, event


class RecordingTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name) / "run"

    def run_ballast(self, *arguments):
        line = [os.environ["BALLAST"], "run", *arguments, "--out", str(self.folder), "--quiet"]
        run = subprocess.run(line, capture_output=True, text=True, check=False)
        self.assertIn(run.returncode, (0, 3), run.stderr)
        return Recording(self.folder)

    def unpacked(self, found):
        """As page/samples.js does it, by other means."""
        data = np.frombuffer(gzip.decompress(base64.b64decode(assemble._packed(found))), dtype=np.uint8)
        names, count = assemble.packed_names(found), len(found.columns["time"])
        planes = data.reshape(len(names), 4, count).astype(np.uint32)
        steps = sum(planes[:, byte] << (8 * byte) for byte in range(4))
        bits = np.cumsum(steps, axis=1, dtype=np.uint32)
        return dict(zip(names, bits.view(np.float32)))

    def test_packing_loses_only_digits(self):
        found = Recording(ball(controller=True).write(self.folder))
        columns = self.unpacked(found)
        for name, values in found.columns.items():
            if name != "time":
                # float32 rounds to half a unit in the 24th bit.
                np.testing.assert_allclose(columns[name], values, rtol=2**-24, atol=1e-40, err_msg=name)
        time = columns["time"].astype(float) + columns["time_rest"]
        np.testing.assert_allclose(time, found.columns["time"], rtol=2**-47)

    def test_infinite_and_missing_values_are_packed_as_nan(self):
        found = Recording(detaching_ball().write(self.folder))
        unusual = {3: 1e300, 4: -math.inf, 5: math.nan}  # the first is too large for float32
        values = np.array(found.columns["normal_force"])
        for row, value in unusual.items():
            values[row] = value
        found.columns["normal_force"] = values
        self.assertEqual(list(np.flatnonzero(np.isnan(self.unpacked(found)["normal_force"]))), list(unusual))

    def test_robot_file_has_the_rails(self):
        # The circles of the paper's ball as tests/plots has them, from Frisvad's vectors and not from the firmware.
        found = self.run_ballast("paper_ball", "--set", "duration=0.2")
        self.assertEqual([mass["mass"] for mass in found.robot["masses"]], [1, 1, 1])
        for (radius, axis_cos, axis_sin), mass in zip(BALL_RAILS, found.robot["masses"]):
            points = np.array(mass["rail"]["points"])
            angle = 2 * np.pi * np.arange(len(points)) / len(points)
            expected = radius * (np.outer(np.cos(angle), axis_cos) + np.outer(np.sin(angle), axis_sin))
            np.testing.assert_allclose(points, expected, atol=1e-12)
            self.assertTrue(mass["rail"]["closed"])

    def test_a_line_rail_ends_at_the_shell(self):
        found = self.run_ballast("hop", "--set", "duration=0.05")
        radius, rail = found.robot["ball"]["radius"], found.robot["masses"][0]["rail"]
        np.testing.assert_allclose(np.linalg.norm([rail["points"][0], rail["points"][-1]], axis=1), radius, rtol=1e-12)

    def test_a_rail_with_end_stops_ends_at_them(self):
        found = self.run_ballast("hop", "--set", "duration=0.05", "--set", "mass.0.rail.end_stops=[-0.1, 0.07]")
        points = found.robot["masses"][0]["rail"]["points"]
        np.testing.assert_allclose([points[0], points[-1]], [[0, 0, -0.1], [0, 0, 0.07]], atol=1e-15)

    def test_masses_lie_on_their_rails(self):
        for scenario in ("seam_ball", "desk_ball"):
            found = self.run_ballast(scenario, "--set", "duration=1")
            for i, mass in enumerate(found.robot["masses"]):
                points = np.array(mass["rail"]["points"])
                place = np.array([found.columns[f"mass_B_{3 * i + j}"][::50] for j in range(3)]).T
                distance = np.linalg.norm(place[:, None] - points[None], axis=2).min(axis=1)
                spacing = np.linalg.norm(np.diff(points, axis=0), axis=1).max()
                self.assertLess(distance.max(), 0.51 * spacing)

    def test_without_a_summary_the_log_says_as_much_as_it_can(self):
        found = self.run_ballast("paper_ball", "--set", "envelope.friction_use=0.5")
        summary = found.summary
        (self.folder / "summary.json").unlink()
        alone = Recording(self.folder)
        self.assertTrue(alone.from_log)
        self.assertIn("no summary.json", alone.notes[0])
        self.assertEqual(words.badge(alone), ("Tripped", "bad"))
        for key in ("cause", "time", "tick", "value", "limit"):
            self.assertEqual(alone.summary["trip"][key], summary["trip"][key])
        self.assertAlmostEqual(alone.static_friction_coefficient, 0.35, delta=1e-12)
        # Samples cannot exceed what was found between them, and are 1 ms apart on curves that move by 0.1 in 0.1 s.
        self.assertLessEqual(alone.summary["mu_required"]["max"], summary["mu_required"]["max"])
        self.assertAlmostEqual(alone.summary["mu_required"]["max"], summary["mu_required"]["max"], delta=1e-3)
        self.assertAlmostEqual(alone.summary["control_period"], 1e-3, delta=1e-12)
        self.assertIn("commanded_0", alone.columns)

    def test_of_a_run_that_broke_off_the_black_box_says_what_it_was_and_why(self):
        line = [os.environ["BALLAST"], "run", "paper_ball", "--fault", "peer_killed@0.2", "--out", str(self.folder)]
        self.assertEqual(subprocess.run(line, capture_output=True, check=False).returncode, 2)
        for folder in (self.folder, self.folder / "blackbox"):
            found = Recording(folder)
            self.assertTrue(found.from_log)
            self.assertEqual((found.name, found.summary["seed"], found.summary["surface"]["kinetic_friction"]),
                             ("paper_ball", 0, 0.3))
            self.assertIn("The run could not go on: controller lost: silent for 100 ticks", found.notes[1])

    def test_without_a_robot_file_the_radius_is_the_rolling_one(self):
        found = Recording(ball().write(self.folder))
        # The synthetic run rolls exactly with radius 1, but for the resampling of its attitude.
        self.assertAlmostEqual(found.robot["ball"]["radius"], 1, delta=1e-2)
        self.assertEqual(found.robot["masses"], [{"mass": None, "rail": None}] * 3)
        self.assertIn("no robot.json", found.notes[0])

    def test_a_robot_file_of_another_robot_is_refused(self):
        ball().write(self.folder)
        (self.folder / "robot.json").write_text('{"ball": {"radius": 1}, "masses": []}')
        with self.assertRaisesRegex(LogError, "describes another robot"):
            Recording(self.folder)
        (self.folder / "robot.json").write_text('{"ball": 3}')
        with self.assertRaisesRegex(LogError, "robot.json: not what a run writes"):
            Recording(self.folder)

    def test_a_cut_log_shows_what_comes_before(self):
        ball(controller=True).write(self.folder)
        log = self.folder / "run.lcmlog"
        log.write_bytes(log.read_bytes()[:40000])
        found = Recording(self.folder)
        self.assertLess(len(found.columns["time"]), 60)
        self.assertTrue(any("cut off" in note for note in found.notes))
        self.assert_numbers_are_those_of_the_samples(found)

    def assert_numbers_are_those_of_the_samples(self, found):
        """And not those of summary.json, which knows of more."""
        whole = json.loads((self.folder / "summary.json").read_text())
        contact = found._run.contact  # one sample more than the page draws where the ball's message of a tick is cut
        normal, time = contact["normal_force_n"], contact["time_s"]
        self.assertEqual(found.summary["normal_force"],
                         {"min": normal.min(), "min_time": time[normal.argmin()], "max": normal.max(),
                          "max_time": time[normal.argmax()]})
        self.assertEqual(found.summary["mu_required"]["max"], contact["mu_required"].max())
        self.assertEqual(found.summary["end"], {"reason": None, "time": time[-1]})
        self.assertNotEqual(found.summary["end"]["time"], whole["end"]["time"])
        self.assertTrue(any(f"run.lcmlog ends at t = {time[-1]:.6g} s, but summary.json is of a run that ends "
                            f"at t = {whole['end']['time']:.6g} s" in note for note in found.notes), found.notes)
        # The parameters at a run's beginning hold for every part of it.
        self.assertEqual((found.name, found.summary["surface"]), (whole["scenario"], whole["surface"]))
        self.assertEqual(words.badge(found), ("End not recorded", "unknown"))
        said = " ".join(words.sentences(found)) + str(words.tables(found)) + str(words.numbers(found))
        for left_out in ("no step was lost", "Nothing tripped", "would have held", "torque left"):
            self.assertNotIn(left_out, said)

    def test_a_log_cut_between_two_messages_shows_what_comes_before(self):
        run = ball(controller=True)
        run.events = run.events[:90]
        found = Recording(run.write(self.folder))
        self.assertEqual([note for note in found.notes if "cut off" in note], [])
        self.assert_numbers_are_those_of_the_samples(found)

    def test_a_log_with_a_damaged_tail_is_whole_up_to_its_end(self):
        ball(controller=True).write(self.folder)
        summary = Recording(self.folder).summary
        with open(self.folder / "run.lcmlog", "ab") as log:
            log.write(bytes(100))
        found = Recording(self.folder)
        self.assertTrue(any("no event starts there" in note for note in found.notes))
        self.assertEqual(found.summary, summary)

    def test_another_name_of_the_log_is_not_what_the_summary_speaks_of(self):
        ball().write(self.folder)
        (self.folder / "run.lcmlog").rename(self.folder / "lcmlog-today.00")
        self.assertTrue(Recording(self.folder / "lcmlog-today.00").from_log)

    def test_two_runs_in_one_log_are_refused(self):
        run = ball()
        run.events += ball().events
        run.write(self.folder)
        with self.assertRaisesRegex(LogError, "BALLAST_CONTACT goes from tick 200 to tick 0: more than one run"):
            Recording(self.folder)

    def test_long_runs_are_thinned_and_keep_their_extremes(self):
        ball().write(self.folder)
        with mock.patch.object(recording, "MOST_SAMPLES", 60):
            thin = Recording(self.folder)
        whole = Recording(self.folder)
        self.assertLessEqual(len(thin.columns["time"]), 61)
        self.assertIn("of 201 samples", thin.notes[-1])
        for name in ("normal_force", "static_friction", "mu_required"):
            for extreme in (np.nanmin, np.nanmax):
                self.assertEqual(extreme(thin.columns[name]), extreme(whole.columns[name]))
        self.assertEqual(thin.columns["time"][-1], whole.columns["time"][-1])

    def test_the_program_says_what_is_wrong(self):
        cases = [("nowhere", "nowhere: no such file or folder"), ("empty", "the log is empty"),
                 ("nonsense", "not an LCM event log"), ("json", "summary.json: not valid JSON")]
        for name, said in cases:
            folder = self.folder / name
            if name != "nowhere":
                ball().write(folder)
            if name in ("empty", "nonsense"):
                (folder / "run.lcmlog").write_bytes(b"" if name == "empty" else b"no log, but long enough for one head")
            if name == "json":
                (folder / "summary.json").write_text("{")
            stderr = io.StringIO()
            with mock.patch.object(sys, "argv", ["ballast-report", str(folder)]), contextlib.redirect_stderr(stderr):
                self.assertEqual(report.main(), 2)
            self.assertIn(said, stderr.getvalue())
            self.assertFalse((folder / "report.html").exists())

    def refusal(self, folder):
        stderr = io.StringIO()
        with mock.patch.object(sys, "argv", ["ballast-report", str(folder)]), contextlib.redirect_stderr(stderr):
            self.assertEqual(report.main(), 2)
        self.assertFalse((folder / "report.html").exists())
        return stderr.getvalue()

    def test_a_summary_no_run_writes_is_refused(self):
        for key, value, said in (("end", "x", 'end is "x"; allowed: an object'),
                                 ("surface", None, "surface is null; allowed: an object"),
                                 ("regimes", [1], "regimes.0 is 1; allowed: an object"),
                                 ("trip", {"cause": "friction"}, "trip.time is missing"),
                                 ("mu_required", {"max": "much", "time": 1}, 'mu_required.max is "much"; allowed: a number'),
                                 ("motors", [3], "motors.0 is 3; allowed: an object"),
                                 ("control_period", 10**400, "allowed: a number")):
            run = ball()
            run.summary[key] = value
            self.assertIn(f"summary.json: {said}" if key != "control_period" else said,
                          self.refusal(run.write(self.folder)))

    def test_a_mass_count_no_message_has_room_for_is_refused(self):
        for count in (100, -1):
            run = ball()
            state = ballast.plant_state_t()
            state.tick, state.mass_count = 300, count
            run.events.append(event(len(run.events), 1, "BALLAST_PLANT_STATE", state.encode()))
            self.assertIn(f"run.lcmlog: BALLAST_PLANT_STATE, tick 300: mass_count is {count}; allowed: 0 to",
                          self.refusal(run.write(self.folder)))

    def test_words_for_ends(self):
        found = Recording(ball().write(self.folder))
        self.assertEqual(words.badge(found), ("Held", "good"))
        self.assertIn("never left the ground", " ".join(words.sentences(found)))
        found = Recording(detaching_ball().write(self.folder))
        self.assertEqual(words.badge(found), ("Left the ground", "bad"))
        said = " ".join(words.sentences(found))
        self.assertIn("N fell to 0", said)
        self.assertIn("no friction is enough", said)

    def test_faults_are_said_whatever_they_are(self):
        run = ball()
        self.assertNotIn("injected faults", " ".join(words.sentences(Recording(run.write(self.folder)))).lower())
        run.summary["faults"] = [{"kind": "lost_steps", "time": 0.5, "mass": 2, "steps": -16, "until": None},
                                 {"kind": "sensor_stuck", "time": None, "loud": True, "at": [1, 2]},
                                 {"what": "a kind of its own"}]
        found = Recording(run.write(self.folder))
        said = " ".join(words.sentences(found)).replace("\u00a0", " ")
        self.assertIn("Injected faults: lost steps at t = 0.5 s (mass 2, steps -16); sensor stuck (loud yes, at "
                      "[1, 2]); fault (what a kind of its own).", said)
        table = next(table for table in words.tables(found) if table.title == "Injected faults")
        self.assertEqual(table.rows[:2], [["lost steps", "0.5", "mass 2, steps -16"],
                                          ["sensor stuck", "–", "loud yes, at [1, 2]"]])
        self.assertEqual(words.events(found), [(0.5, "fault: lost steps")])
        run.summary["faults"] = [3]
        self.assertIn("faults.0 is 3; allowed: an object", self.refusal(run.write(self.folder)))

    def test_a_slide_on_a_patch_is_told_as_a_run_tells_it(self):
        run = ball()
        run.summary["trip"] = {"cause": "friction", "time": 0.0, "tick": 0, "value": 0.117, "limit": 0.5, "latency_ticks": None}

        def said():
            return " ".join(words.sentences(Recording(run.write(self.folder)))).replace("\u00a0", " ")

        slid = "Tripped at t = 0 s: friction: the ball slid at f_s/N = 0.117, on a floor that was to hold up to 0.5"
        self.assertIn(slid + ".", said())
        (self.folder / "scenario.toml").write_text(
            "[[surface.patch]]\ncircle = { center = [0, 0], radius = 0.01 }\nstatic_friction = 0.05\n")
        self.assertIn(slid + " (mu_s = 0.05 where it was).", said())
        self.assertIn((0.0, "trip: the ball slid"), words.events(Recording(self.folder)))
        found = words.numbers(Recording(self.folder))
        self.assertEqual(next(number.value for number in found if number.label == "least mu_s under the ball"), 0.05)
        self.assertIn("floor_friction", Recording(self.folder).columns)
        run.summary["trip"].update(value=0.6)
        self.assertIn("the friction came up to its limit, 0.6 where 0.5 is the limit", said())

    def test_moves_and_stops_with_and_without_numbers(self):
        run = ball()
        plan = {"start": 0.25, "duration": 0.5, "predicted_normal_force_min": 3.5, "predicted_mu_required_max": 0.125,
                "predicted_margin_min": 0.75, "margin_min": 0.625, "arrived": True}
        run.summary.update(move=plan, stop={**plan, "predicted_mu_required_max": None, "margin_min": None})
        table = next(table for table in words.tables(Recording(run.write(self.folder))) if "Moves" in table.title)
        self.assertEqual(table.rows, [["move", "0.25", "0.5", "3.5", "0.125", "0.75", "0.625"],
                                      ["stop", "0.25", "0.5", "3.5", "–", "0.75", "–"]])
        run.summary["move"] = None
        run.summary["stop"] = {"start": 1}
        self.assertIn("stop.duration is missing", self.refusal(run.write(self.folder)))

    def test_what_is_not_a_page_is_never_written_over(self):
        ball().write(self.folder)
        robot = {"ball": {"radius": 1}, "masses": [{"mass": 1, "rail": None}] * 3}
        (self.folder / "robot.json").write_text(json.dumps(robot))
        (self.folder / "other.html").write_text("<!doctype html>\n<p>a page of somebody's\n")
        os.symlink("nowhere.html", self.folder / "link.html")
        kept = {path.name: path.read_bytes() for path in self.folder.iterdir() if not path.is_symlink()}
        both = [str(self.folder)] * 2
        for name, said in (("run.lcmlog", "is an input of this program"), ("summary.json", "is an input of this program"),
                           ("robot.json", "is an input of this program"), ("other.html", "exists and is no page of ballast"),
                           ("link.html", "is a symbolic link"), ("/dev/null", "is a device")):
            for program, runs in ((report, both[:1]), (compare, both)):
                stderr = io.StringIO()
                line = [program.__name__, *runs, "--out", str(self.folder / name)]
                with mock.patch.object(sys, "argv", line), contextlib.redirect_stderr(stderr):
                    self.assertEqual(program.main(), 2)
                self.assertIn(f"{self.folder / name} {said}", stderr.getvalue())
        self.assertEqual({path.name: path.read_bytes() for path in self.folder.iterdir() if not path.is_symlink()},
                         kept)
        self.assertTrue(os.path.islink(self.folder / "link.html"))

    def test_what_json_cannot_say_is_null(self):
        self.assertEqual(json.loads(json.dumps(assemble.finite({"a": [math.inf, 1.0, math.nan]}), allow_nan=False)),
                         {"a": [None, 1.0, None]})


if __name__ == "__main__":
    unittest.main()
