"""The pictures of a plan: what is drawn is what scenario.toml and the log say."""

import tempfile
import unittest
from pathlib import Path

import numpy as np
from matplotlib.patches import Circle

import chart
import plan_pictures
import sweep_map
from planned import read_planned
from recorded_run import RecordedRun
from synthetic_run import ball

TASK = """
[ball]
radius = 0.5
[surface]
static_friction = 0.4
[envelope]
friction_use = 0.9
[task]
goal = [3.0, 1.0]
via = [ { position = [1.0, 0.5], time = 4.0 }, { position = [2.0, 0.5] } ]
keep_out = [ { center = [1.5, -1.0], radius = 0.25 } ]
follow = { points = [[0.0, 0.0], [2.0, 0.5], [3.0, 1.0]], tolerance = 0.2 }
friction_use = 0.75
[plan]
mu_required = 0.2
path = [ [0.0, 0.0, 0.0, 0.01], [10.0, 1.5, 0.5, 0.2], [20.0, 3.0, 1.0, 0.05] ]
"""


class PlanPictures(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def recorded(self, scenario=TASK):
        folder = ball().write(self.folder)
        if scenario is not None:
            (Path(folder) / "scenario.toml").write_text(scenario)
        return RecordedRun(folder)

    @staticmethod
    def circles(figure):
        return {(*np.round(patch.center, 6), round(patch.radius, 6))
                for patch in figure.axes[0].patches if isinstance(patch, Circle)}

    def test_a_run_without_a_plan_has_none_of_them(self):
        for scenario in (None, "[ball]\nradius = 0.5\n", "no TOML [", TASK.replace("[plan]", "[planned]")):
            with self.subTest(scenario):
                run = self.recorded(scenario)
                self.assertIsNone(plan_pictures.plan_path(run))
                self.assertIsNone(plan_pictures.plan_need(run))
                (self.folder / "scenario.toml").unlink(missing_ok=True)

    def test_the_map_has_obstacles_with_the_balls_radius_around_them(self):
        figure = plan_pictures.plan_path(self.recorded())
        self.assertLessEqual({(1.5, -1.0, 0.25), (1.5, -1.0, 0.75)}, self.circles(figure))

    def test_the_map_has_planned_and_driven_path(self):
        run = self.recorded()
        figure = plan_pictures.plan_path(run)
        lines = {line.get_label(): line for line in figure.axes[0].lines}
        np.testing.assert_allclose(np.stack(lines["planned"].get_data(), axis=1), run.planned.path[:, 1:3])
        np.testing.assert_allclose(np.stack(lines["driven"].get_data(), axis=1), run.state["position_W_m"][:, :2])

    def test_the_need_has_its_bound(self):
        run = self.recorded()
        figure = plan_pictures.plan_need(run)
        heights = {round(float(line.get_ydata()[0]), 9) for line in figure.axes[0].lines if len(set(line.get_ydata())) == 1}
        self.assertIn(0.3, heights)  # the task's 0.75 mu_s, which is less than the envelope's 0.9

    def test_a_plan_without_a_path_is_drawn_as_far_as_it_goes(self):
        run = self.recorded(TASK[:TASK.index("path =")])
        self.assertIsNotNone(plan_pictures.plan_path(run))
        self.assertIsNotNone(plan_pictures.plan_need(run))

    def test_planned_places_are_interpolated(self):
        (self.folder / "scenario.toml").write_text(TASK)
        planned = read_planned(self.folder)
        np.testing.assert_allclose(planned.place_at(np.array([5.0, 99.0])), [[0.75, 0.25], [3.0, 1.0]])
        np.testing.assert_allclose(planned.need_at(np.array([10.0, 99.0])), [0.2, np.nan])


CHART = """{"scenario": "robot", "distance": 0.5, "at_rest": true, "friction_use": 0.8, "static_friction": 0.5,
"task_duration": 6, "points": [
 {"duration": 3, "mu_required": null, "stepper_mu_required": null, "stepper_end": null},
 {"duration": 4, "mu_required": 0.03, "stepper_mu_required": 0.3, "stepper_end": "completed"},
 {"duration": 8, "mu_required": 0.007, "stepper_mu_required": null, "stepper_end": "detached"}],
"shortest_time": [{"mu_s": 0.01, "duration": 7.5, "limited_by_friction": true, "stepper_duration": null},
 {"mu_s": 0.5, "duration": 4, "limited_by_friction": false, "stepper_duration": 4}]}"""


class ChartPicture(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name) / "chart.json"

    def test_the_curves_are_those_of_the_file(self):
        self.path.write_text(CHART)
        left, right = chart.draw(chart.Chart(self.path)).axes
        np.testing.assert_allclose(left.lines[0].get_data(), [[4, 8], [0.03, 0.007]])
        np.testing.assert_allclose(left.lines[1].get_ydata(), [0.3, np.nan])
        np.testing.assert_allclose(right.lines[0].get_data(), [[0.01, 0.5], [7.5, 4]])

    def test_another_file_is_refused(self):
        for text in ("{}", "[", CHART.replace('"mu_required": 0.03', '"mu_required": null').replace(
                '"mu_required": 0.007', '"mu_required": null')):
            with self.subTest(text[:20]):
                self.path.write_text(text)
                with self.assertRaises(chart.ChartError):
                    chart.draw(chart.Chart(self.path))


MAP = """{"sweep": "push", "scenario": "paper_ball", "rows": 7,
 "x": {"key": "external_force.0", "logarithmic": false, "edges": [-1, 0, 1], "values": [-0.5, 0.5]},
 "y": {"key": "surface.static_friction", "logarithmic": true, "edges": [0.1, 0.2, 0.4], "values": []},
 "runs": [[2, 1], [0, 4]], "held": [[1, 0], [0, 4]]}"""


class SweepMap(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name) / "map.json"

    def test_cells_show_the_share_that_holds(self):
        self.path.write_text(MAP)
        axes = sweep_map.draw(sweep_map.Map(self.path)).axes[0]
        np.testing.assert_array_equal(axes.collections[0].get_array().filled(-1).reshape(2, 2), [[0.5, 0], [-1, 1]])
        self.assertEqual((axes.get_xlabel(), axes.get_yscale()), ("external_force.0", "log"))
        np.testing.assert_array_equal(axes.get_xticks(), [-0.5, 0.5])
        self.assertLessEqual({0.1, 0.2}, set(np.round(axes.get_yticks(), 12)))

    def test_another_file_is_refused(self):
        for text in ("{}", "[", MAP.replace("[[2, 1], [0, 4]]", "[[2, 1]]"), MAP.replace("[[2, 1], [0, 4]]", "[[0, 0], [0, 0]]")):
            with self.subTest(text[:20]):
                self.path.write_text(text)
                with self.assertRaises(sweep_map.MapError):
                    sweep_map.Map(self.path)


if __name__ == "__main__":
    unittest.main()
