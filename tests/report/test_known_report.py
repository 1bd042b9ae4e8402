"""Estimate, measured contact force and belief on the report's page: numbers, map and columns are those of the messages."""

import json
import re
import tempfile
import unittest
from pathlib import Path

import numpy as np

import assemble
import known_report
import synthetic_run
import words
from recording import Recording
from synthetic_run import ball, believe

ROBOT = {"ball": {"radius": 0.5}, "masses": [{"mass": 1.0, "rail": None}] * 3}


class KnownReport(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def recorded(self, belief=False, **options):
        run = ball(**{"known": True, **options})
        if belief:
            believe(run, self.folder)
        folder = Path(run.write(self.folder))
        (folder / "robot.json").write_text(json.dumps(ROBOT))
        return Recording(folder)

    def test_a_run_without_them_shows_nothing(self):
        recording = self.recorded(known=False, controller=True)
        self.assertEqual(known_report.known_html(recording), "")
        self.assertEqual(known_report.known_sentence(recording) + known_report.belief_sentence(recording), "")
        for table in (known_report.known_table, known_report.flag_table, known_report.belief_table):
            self.assertIsNone(table(recording))
        self.assertFalse([name for name in recording.columns
                          if name.startswith(("measured", "estimated", "believed", "true_", "tilt", "yaw", "place_"))])
        described = assemble._described(recording)
        self.assertEqual((described["flags"], described["notes"]), ([], {}))

    def test_columns_are_those_of_the_messages(self):
        recording = self.recorded()
        columns, time = recording.columns, recording.columns["time"]
        of_normal, of_need = np.array([synthetic_run.measured_error(t) for t in time]).T
        for name, error in (("normal_force", of_normal), ("mu_required", of_need)):
            np.testing.assert_allclose(columns[f"measured_{name}"] - columns[name], error, atol=1e-9)
        np.testing.assert_allclose(columns["yaw_error_0"], [synthetic_run.yaw_error_deg(t) for t in time], atol=1e-9)
        np.testing.assert_allclose(columns["place_error_1"], [synthetic_run.place_error_m(t)[1] for t in time], atol=1e-12)
        for name, key in (("tilt_error", "tilt"), ("gyro_bias", "bias"), ("place_error", "place"),
                          ("measured_mu_required", "need"), ("measured_slip", "slip")):
            np.testing.assert_allclose(columns[f"{name}_sigma"], synthetic_run.KNOWN_SIGMA[key], rtol=1e-12)

    def test_table_and_sentence_say_how_large_and_how_honest(self):
        recording = self.recorded()
        rows = {row[0]: row[1:] for row in known_report.known_table(recording).rows}
        self.assertEqual(rows["yaw [\u00b0]"], ["3.47", "6", "2", "67 %", "3"])
        self.assertEqual(rows["measured N [N]"][3], "100 %")
        self.assertIn("0.157\u00b0 of tilt", known_report.known_sentence(recording))
        self.assertIn("67 % inside", known_report.plot_notes(recording)["yaw_error"])

    def test_flags_are_events(self):
        recording = self.recorded()
        self.assertEqual([(time, text) for time, text in words.events(recording)],
                         [(5.0, "the robot flags slip, the first of 2 times"), (12.0, "the robot flags light contact")])
        self.assertEqual([row[0] for row in known_report.flag_table(recording).rows], ["slip", "slip", "light contact"])

    def test_a_trip_that_a_stop_led_to_is_named_after_its_cause(self):
        recording = self.recorded()
        recording.summary["trip"] = {"cause": "slip_measured", "time": 6.0, "value": 64, "limit": 0,
                                     "monitor": {"cause": "friction", "time": 8.0, "value": 0.2, "limit": 0.17}}
        self.assertIn((8.0, "trip: the friction came up to its limit"), words.events(recording))
        said = [sentence for sentence in words.sentences(recording) if sentence.startswith("Tripped")]
        self.assertEqual(said, ["Tripped at t\u00a0=\u00a06\u00a0s: the robot measured slip; then the monitor tripped at "
                                "t\u00a0=\u00a08\u00a0s: the friction came up to its limit, 0.2 where 0.17 is the limit."])

    def test_the_map_is_to_scale(self):
        recording = self.recorded(belief=True)
        said = known_report.known_html(recording)
        scale, x, y = (float(re.search(rf'data-{name}="([^"]+)"', said)[1]) for name in ("scale", "x", "y"))
        circles = re.findall(r'<circle class="sure" cx="([^"]+)" cy="([^"]+)" r="([^"]+)"', said)
        # The drawing has one decimal.
        np.testing.assert_allclose([float(r) for *_, r in circles], 2 * synthetic_run.KNOWN_SIGMA["place"] * scale, atol=0.051)
        end = [float(value) for value in circles[-1][:2]]
        place = recording.driven()[-1] + synthetic_run.place_error_m(20.0)
        np.testing.assert_allclose(end, [x + scale * place[0], y - scale * place[1]], atol=0.051)
        height = float(re.search(r'viewBox="0 0 1000 (\d+)"', said)[1])
        for line in re.findall(r'<polyline class="(?:driven|estimated|believed)" points="([^"]+)"', said):
            points = np.array([[float(value) for value in pair.split(",")] for pair in line.split()])
            self.assertTrue(((points >= 0) & (points <= [1000, height])).all())
        self.assertEqual(len(re.findall("<polyline", said)), 3)

    def test_belief_stands_beside_truth(self):
        recording = self.recorded(known=False, belief=True)
        self.assertIn("0.17", known_report.belief_sentence(recording))
        self.assertIn("0.5 m from where the real one ended", known_report.belief_sentence(recording))
        rows = {row[0]: row[1:] for row in known_report.belief_table(recording).rows}
        self.assertEqual(rows["least N [N]"][0], "30")
        found = recording.predicted
        np.testing.assert_allclose(recording.columns["believed_normal_force"],
                                   np.interp(recording.columns["time"], found.time_s, found.normal_n), rtol=1e-12)
        # belief.csv has a tenth less of e1, and the whole of e2; its rows are 1 s apart.
        self.assertAlmostEqual(recording.columns["believed_off_0"][-1], 0.1 * recording.driven()[-1][0], delta=1e-9)
        self.assertAlmostEqual(recording.columns["believed_off_1"][-1], 0, delta=1e-9)

    def test_a_log_of_another_name_has_not_the_prediction_beside_it(self):
        folder = Path(believe(ball(), self.folder).write(self.folder))
        (folder / "other.lcmlog").write_bytes((folder / "run.lcmlog").read_bytes())
        self.assertIsNone(Recording(folder / "other.lcmlog").predicted)


if __name__ == "__main__":
    unittest.main()
