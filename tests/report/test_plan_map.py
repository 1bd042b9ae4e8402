"""The plan on the report's page: the map's circles and paths are where scenario.toml and the log say."""

import json
import re
import tempfile
import unittest
from pathlib import Path

import numpy as np

import plan_map
from recording import Recording
from synthetic_run import ball
from test_plan_pictures import TASK

ROBOT = {"ball": {"radius": 0.5}, "masses": [{"mass": 1.0, "rail": None}] * 3}


class PlanMap(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def recorded(self, scenario):
        folder = Path(ball().write(self.folder))
        (folder / "robot.json").write_text(json.dumps(ROBOT))
        if scenario:
            (folder / "scenario.toml").write_text(scenario)
        return Recording(folder)

    def test_a_run_without_a_plan_has_no_map(self):
        recording = self.recorded("")
        self.assertEqual(plan_map.plan_html(recording), "")
        self.assertEqual(plan_map.plan_sentence(recording), "")
        self.assertIsNone(plan_map.plan_table(recording))
        self.assertNotIn("planned_mu_required", recording.columns)

    def test_circles_are_to_scale(self):
        said = plan_map.plan_html(self.recorded(TASK))
        scale, x, y = (float(re.search(rf'data-{name}="([^"]+)"', said)[1]) for name in ("scale", "x", "y"))
        for name, radius in (("obstacle", 0.25), ("clearance", 0.75)):
            circle = re.search(rf'<circle class="{name}" cx="([^"]+)" cy="([^"]+)" r="([^"]+)"', said)
            found = [float(value) for value in circle.groups()]
            # The drawing has one decimal.
            np.testing.assert_allclose(found, [x + 1.5 * scale, y + 1.0 * scale, radius * scale], atol=0.051)

    def test_everything_is_inside_the_drawing(self):
        said = plan_map.plan_html(self.recorded(TASK))
        height = float(re.search(r'viewBox="0 0 1000 (\d+)"', said)[1])
        for circle in re.findall(r'<circle[^>]* cx="([^"]+)" cy="([^"]+)" r="([^"]+)"', said):
            cx, cy, r = map(float, circle)
            self.assertGreaterEqual(cx - r, 0)
            self.assertLessEqual(cx + r, 1000)
            self.assertGreaterEqual(cy - r, 0)
            self.assertLessEqual(cy + r, height)

    def test_the_planned_need_is_a_column(self):
        recording = self.recorded(TASK)
        time, planned = recording.columns["time"], recording.columns["planned_mu_required"]
        np.testing.assert_allclose(planned, np.interp(time, [0, 10, 20], [0.01, 0.2, 0.05], right=np.nan))

    def test_table_and_sentence_name_the_distance_from_the_goal(self):
        recording = self.recorded(TASK)
        off = np.linalg.norm(recording.driven()[-1] - (3.0, 1.0))
        self.assertIn(f"{off:.3g} m", plan_map.plan_sentence(recording))
        rows = {row[0]: row[1:] for row in plan_map.plan_table(recording).rows}
        self.assertEqual(rows["distance from the goal"], ["0 mm", f"{off:.3g} m"])
        self.assertEqual(rows["a plan may use 0.75 mu_s"], ["0.3", "–"])


if __name__ == "__main__":
    unittest.main()
