"""The pictures of whole runs: that all are drawn, that they show the data, and what they do in the unusual cases."""

import contextlib
import io
import math
import sys
import tempfile
import unittest
import warnings
from pathlib import Path
from unittest import mock

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.legend import Legend
from matplotlib.patches import Polygon
from matplotlib.quiver import Quiver

import floor_patches
import page
import pictures
import plot
from event_log import LogError
from layout import assert_words_apart
from recorded_run import RecordedRun
from synthetic_run import ball, detaching_ball, disk, read_reference

ALWAYS = {"normal_force", "static_friction", "friction_required", "path", "angular_velocity", "body_frame", "motors"}


class PicturesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name) / "run"

    def recorded(self, synthetic):
        return RecordedRun(synthetic.write(self.folder))

    def call_plot(self, *more, only=tuple(pictures.PICTURES)):
        """(exit status, what went to stderr) of ballast-plot, as if there were only those pictures."""
        stderr = io.StringIO()
        known = mock.patch.object(plot, "PICTURES", {name: pictures.PICTURES[name] for name in only})
        arguments = mock.patch.object(sys, "argv", ["ballast-plot", str(self.folder), *more])
        with known, arguments, contextlib.redirect_stderr(stderr):
            return plot.main(), stderr.getvalue()

    def drawn(self):
        return {path.stem for path in self.folder.glob("*.png")}

    @staticmethod
    def line(axes, color):
        """The longest line of that colour, as (x, y)."""
        lines = [line for line in axes.get_lines() if line.get_color() == color]
        return max(lines, key=lambda line: len(line.get_xdata())).get_data()

    @staticmethod
    def texts(figure):
        """Everything the legends and titles of a figure say."""
        found = []
        for axes in figure.axes:
            found += [axes.get_title(loc="left"), axes.get_title(loc="right")]
            for legend in axes.findobj(Legend):
                found += [text.get_text() for text in legend.get_texts()]
        return "\n".join(found)

    def assert_shows_ink(self, path, color=None):
        """Not blank: at least one of a thousand points is not white, and the colour of the curves is there."""
        image = imread(path)[:, :, :3]
        self.assertGreater(np.mean(np.any(image < 0.9, axis=2)), 1e-3, path.name)
        if color is not None:
            # Anti-aliasing leaves the middle of a line in its pure colour; 8 bits per channel round to 1/255.
            close = np.all(np.abs(image - np.array(to_rgb(color))) < 0.01, axis=2)
            self.assertGreater(close.sum(), 50, path.name)

    def test_all_pictures_of_a_prescribed_run(self):
        ball().write(self.folder)
        self.assertEqual(self.call_plot(), (0, ""))
        self.assertEqual(self.drawn(), ALWAYS)
        for path in self.folder.glob("*.png"):
            self.assert_shows_ink(path, pictures.BLUE)

    def test_a_run_with_controller_adds_the_masses(self):
        disk(controller=True).write(self.folder)
        self.assertEqual(self.call_plot(), (0, ""))
        self.assertEqual(self.drawn(), ALWAYS | {"masses", "motor_share"})
        for path in self.folder.glob("*.png"):
            self.assert_shows_ink(path, pictures.BLUE)

    def test_other_formats(self):
        ball(period_s=0.5).write(self.folder)
        self.assertEqual(self.call_plot("--format", "svg"), (0, ""))
        self.assertEqual({path.stem for path in self.folder.glob("*.svg")}, ALWAYS)
        self.assertEqual(self.drawn(), set())

    def test_curves_are_the_reference_run_without_the_countdown(self):
        run = self.recorded(ball())
        reference = read_reference("paper_ball")
        friction = np.hypot(reference["f_1"], reference["f_2"])
        for draw, expected in ((pictures.normal_force, reference["N"]),
                               (pictures.static_friction, friction),
                               (pictures.friction_required, friction / reference["N"]),
                               (pictures.angular_velocity, reference["Omega_1"])):
            with self.subTest(picture=draw.__name__):
                time, value = self.line(draw(run).axes[0], pictures.BLUE)
                # The reference's own times, found again by k * 0.1 and interpolation: rounding only.
                np.testing.assert_allclose(time, reference["t"], rtol=0, atol=1e-12)
                np.testing.assert_allclose(value, expected, rtol=1e-9, atol=1e-12)
        z = self.line(pictures.path(run).axes[0], pictures.BLUE)
        np.testing.assert_allclose(z, (reference["z_1"], reference["z_2"]), rtol=0, atol=1e-11)

    def test_maximum_and_limit_are_labelled(self):
        synthetic = ball()
        synthetic.summary["mu_required"] = {"max": 0.190612, "time": 6.4321}
        said = self.texts(pictures.friction_required(self.recorded(synthetic)))
        self.assertIn("maximum 0.191 at $t$ = 6.432 s (between ticks)", said)
        self.assertIn("= 0.35", said)

    def test_maximum_in_a_tick_is_said_to_be_nowhere_else(self):
        self.assertNotIn("between ticks", self.texts(pictures.friction_required(self.recorded(ball()))))

    def test_shortest_runs_are_drawn_without_a_warning(self):
        for ticks, end_s, normal_force_n in ((1, 0.0, 0.9), (1, 0.0, -2.0), (1, 0.05, 0.9), (2, 0.1, 0.9)):
            synthetic = ball(controller=True)
            synthetic.events = synthetic.events[:3 * (2 + ticks)]  # two of the countdown, three messages each
            synthetic.summary.update({
                "end": {"reason": "slipped", "time": end_s},
                "trip": {"cause": "friction", "time": end_s, "value": 0.4, "limit": 0.35},
                "mu_required": {"max": 0.4, "time": end_s},
                "normal_force": {"min": normal_force_n, "min_time": end_s},
                "static_friction": {"max": 0.3, "time": end_s},
                "regimes": [{"regime": "rolling", "start": 0.0, "end": end_s}],
            })
            run = self.recorded(synthetic)
            run.contact = run.contact.copy()
            run.contact["normal_force_n"] = normal_force_n
            for name, draw in pictures.PICTURES.items():
                if name.startswith("plan_") or name in ("estimate", "belief"):  # this run has none of them
                    continue
                run.summary["regimes"][0]["regime"] = "flight" if name == "height" else "rolling"
                with self.subTest(picture=name, ticks=ticks, normal_force=normal_force_n), warnings.catch_warnings():
                    warnings.simplefilter("error")
                    draw(run).savefig(io.BytesIO(), dpi=30)

    def test_limit_far_above_does_not_squeeze_the_curve(self):
        synthetic = ball()
        synthetic.summary["surface"]["static_friction"] = 50.0
        figure = pictures.friction_required(self.recorded(synthetic))
        self.assertLess(figure.axes[0].get_ylim()[1], 0.25)
        self.assertIn("= 50, far above", self.texts(figure))

    def test_ratio_without_bound_leaves_a_readable_axis(self):
        run = self.recorded(detaching_ball())
        figure = pictures.friction_required(run)
        ratio = run.friction_required()
        self.assertGreater(np.nanmax(ratio), 1e6)
        self.assertLess(figure.axes[0].get_ylim()[1], 5)
        said = self.texts(figure)
        self.assertIn("no bound, $N$ = 0, above this axis", said)
        self.assertIn("perfect friction", said)

    def test_early_end_is_marked_with_its_reason(self):
        run = self.recorded(detaching_ball())
        for name in ("normal_force", "static_friction", "friction_required", "angular_velocity"):
            with self.subTest(picture=name):
                figure = pictures.PICTURES[name](run)
                self.assertIn("the ball leaves the surface", self.texts(figure))
                upright = [line for line in figure.axes[0].get_lines() if list(line.get_xdata()) == [run.end_s] * 2]
                self.assertEqual(len(upright), 1)

    def test_trip_is_marked_where_it_happened(self):
        synthetic = ball()
        synthetic.summary["trip"] = {"cause": "friction", "time": 6.0, "value": 0.2, "limit": 0.17, "latency_ticks": 1}
        synthetic.summary["end"]["reason"] = "tripped"
        figure = pictures.normal_force(self.recorded(synthetic))
        self.assertIn("monitor trips: friction at its limit, $t$ = 6 s", self.texts(figure))
        self.assertTrue(any(list(line.get_xdata()) == [6.0, 6.0] for line in figure.axes[0].get_lines()))

    def test_both_trips_are_marked_with_who_tripped(self):
        synthetic = ball()
        synthetic.summary["trip"] = {
            "cause": "slip_measured", "time": 6.0, "value": 64, "limit": 0, "latency_ticks": None,
            "monitor": {"cause": "friction", "time": 8.0, "value": 0.2, "limit": 0.17}}
        said = self.texts(pictures.normal_force(self.recorded(synthetic)))
        self.assertIn("controller trips: the robot measures slip, $t$ = 6 s", said)
        self.assertIn("monitor trips: friction at its limit, $t$ = 8 s", said)

    def test_completed_run_has_no_event_lines(self):
        said = self.texts(pictures.normal_force(self.recorded(ball())))
        self.assertNotIn("monitor", said)
        self.assertNotIn("surface", said)

    def test_flight_is_a_gap_in_the_ratio_and_shaded(self):
        synthetic = ball()
        synthetic.summary["regimes"] = [{"regime": "rolling", "start": 0, "end": 5},
                                        {"regime": "flight", "start": 5, "end": 20}]
        run = self.recorded(synthetic)
        run.contact = run.contact.copy()
        run.contact["regime"][run.contact["time_s"] >= 5] = 2
        figure = pictures.friction_required(run)
        self.assertIn("flight", self.texts(figure))
        time, ratio = self.line(figure.axes[0], pictures.BLUE)
        self.assertTrue(np.all(np.isnan(ratio[time >= 5])))
        self.assertTrue(np.all(np.isfinite(ratio[time < 5])))

    def flying(self):
        """The ball as if it hopped 0.3 m high from t = 5 s to 7 s and bounced 0.1 m high up to 8 s."""
        synthetic = ball()
        synthetic.summary["regimes"] = [{"regime": "rolling", "start": 0, "end": 3},
                                        {"regime": "sliding", "start": 3, "end": 5},
                                        {"regime": "flight", "start": 5, "end": 8},
                                        {"regime": "rolling", "start": 8, "end": 20}]
        synthetic.summary["impacts"] = [{"time": t} for t in (7.0, 8.0, 8.001, 8.002)]
        run = self.recorded(synthetic)
        run.contact, run.state = run.contact.copy(), run.state.copy()
        time = run.contact["time_s"]
        run.contact["regime"][(time >= 3) & (time < 5)] = 1
        run.contact["regime"][(time >= 5) & (time < 8)] = 2
        for low, high, top in ((5, 7, 0.3), (7, 8, 0.1)):
            inside = (time >= low) & (time <= high)
            part = (time[inside] - low) / (high - low)
            run.state["position_W_m"][inside, 2] = 4 * top * part * (1 - part)
        return run

    def test_height_is_drawn_of_a_ball_that_leaves_the_ground(self):
        self.assertIsNone(pictures.height(self.recorded(ball())))
        run = self.flying()
        figure = pictures.height(run)
        time, height = self.line(figure.axes[0], pictures.BLUE)
        np.testing.assert_array_equal(height, run.state["position_W_m"][:, 2])
        self.assertIn("highest 0.3 at $t$ = 6 s", self.texts(figure))

    def test_regimes_and_impacts_are_on_every_picture_over_time(self):
        run = self.flying()
        for name in ("normal_force", "static_friction", "friction_required", "angular_velocity", "height", "motors"):
            figure = pictures.PICTURES[name](run)
            said = self.texts(figure)
            with self.subTest(picture=name):
                for word in ("sliding", "flight", "4 impacts"):
                    self.assertIn(word, said)
                for axes in figure.axes:
                    shades = [patch.get_xy()[:, 0] for patch in axes.patches if isinstance(patch, Polygon)]
                    self.assertEqual([(xs.min(), xs.max()) for xs in shades], [(3, 5), (5, 8)])
                    # The last three are too close to tell apart.
                    upright = [line.get_xdata()[0] for line in axes.get_lines()
                               if line.get_linestyle() == ":" and line.get_xdata()[0] == line.get_xdata()[-1]]
                    self.assertEqual(upright, [7.0, 8.0])

    def test_path_shows_regimes_and_impacts_where_they_were(self):
        run = self.flying()
        figure = pictures.path(run)
        said = self.texts(figure)
        for word in ("sliding", "flight", "4 impacts"):
            self.assertIn(word, said)
        bands = [line for line in figure.axes[0].get_lines() if line.get_linewidth() == 9]
        time = run.state["time_s"]
        self.assertEqual([len(band.get_xdata()) for band in bands],
                         [np.sum((time >= 3) & (time <= 5)), np.sum((time >= 5) & (time <= 8))])
        cross, = [line for line in figure.axes[0].get_lines() if line.get_marker() == "x"]
        z = run.state["position_W_m"][time == 7.0][0]
        np.testing.assert_allclose(cross.get_xydata()[0], z[:2], rtol=0, atol=1e-12)  # interpolation: rounding only

    def test_friction_while_sliding_is_not_said_to_be_needed(self):
        self.assertIn("kinetic where it slides", self.texts(pictures.friction_required(self.flying())))
        self.assertNotIn("kinetic", self.texts(pictures.friction_required(self.recorded(ball()))))

    def test_a_ball_that_hops_in_place(self):
        run = self.flying()
        run.state["position_W_m"][:, :2] = 0
        run.contact["friction_force_W_n"][:] = 0
        run.contact["static_friction_n"][:] = 0
        run.contact["mu_required"][:] = 0
        run.summary["mu_required"] = {"max": None, "time": 5.0}
        run.summary["static_friction"] = {"max": 0.0, "time": 0.0}
        self.assertIn("it stays in place", self.texts(pictures.path(run)))
        for draw in (pictures.static_friction, pictures.friction_required):
            self.assertLess(draw(run).axes[0].get_ylim()[0], 0)  # else the curve would hide in the axis

    def test_ball_without_masses_has_no_pictures_of_them(self):
        run = self.recorded(ball())
        run.mass_count = 0
        run.summary["motors"] = []
        self.assertIsNone(pictures.body_frame(run))
        self.assertIsNone(pictures.motors(run))

    def test_motors_are_those_of_the_log_and_summary(self):
        for controller in (False, True):
            run = self.recorded(ball(controller=controller))
            figure = pictures.motors(run)
            said = self.texts(figure)
            time, theta = run.state["time_s"], run.state["mass_position"]
            shaft_radps = 3 * run.state["mass_velocity"]
            for i in range(3):
                with self.subTest(controller=controller, motor=i):
                    left, right = figure.axes[2 * i], figure.axes[2 * i + 1]
                    torque = 0.5 * (i + 1) * np.sin(time)
                    color = pictures.MASS_COLORS[i]
                    np.testing.assert_allclose(self.line(left, color)[1], torque, rtol=0, atol=1e-12)
                    # From 0.3 rad/s of the shaft on, 4 N m fall as 0.3 / speed; drag and, driven, detent come on top.
                    available = np.where(shaft_radps[:, i] <= 0.3, 4, 1.2 / np.maximum(shaft_radps[:, i], 0.1))
                    drawn = torque + 0.5 * shaft_radps[:, i]
                    if controller:
                        drawn = drawn + 0.25 * np.sin(4 * 50 * 3 * theta[:, i])
                    margin = self.line(right, color)[1]
                    # 600 theta is below 1e4, so that the sine keeps 1e-12.
                    np.testing.assert_allclose(margin, 100 * (1 - np.abs(drawn) / available), rtol=0, atol=1e-9)
                    limits = [line.get_ydata() for line in left.get_lines() if line.get_linestyle() == "--"]
                    np.testing.assert_allclose(limits, [available, -available], rtol=1e-12)
                    self.assertIn(f"mass {i}: at most {1.25 + i:g} of 2.67 to 4 N m", said)
                    self.assertIn(f"least margin {50 - 12.5 * i:g} %", said)
            self.assertEqual("needed" in said, not controller)

    def test_strong_and_weak_motors_keep_the_axes_readable(self):
        synthetic = ball()
        synthetic.summary["motors"][0]["parameters"]["holding_torque"] = 1000.0
        synthetic.summary["motors"][1].update({"torque_margin": -30.0, "max_torque": 50.0})
        figure = pictures.motors(self.recorded(synthetic))
        self.assertFalse([line for line in figure.axes[0].get_lines() if line.get_linestyle() == "--"])
        self.assertLess(figure.axes[0].get_ylim()[1], 1)
        self.assertGreater(figure.axes[3].get_ylim()[0], -150)
        self.assertIn("least margin -3000 %, off this axis", self.texts(figure))

    def test_motors_without_parameters_are_said_to_be_missing(self):
        synthetic = ball(period_s=1.0)
        del synthetic.summary["motors"][1]["parameters"]["corner_speed"]
        synthetic.write(self.folder)
        status, said = self.call_plot(only=("motors",))
        self.assertEqual(status, 2)
        self.assertRegex(said, r"summary\.json: motors\[1\]: 'corner_speed' is missing")
        synthetic.summary["motors"] = []
        synthetic.write(self.folder)
        self.assertRegex(self.call_plot(only=("motors",))[1], "motors has 0 entries; the log shows 3")

    def test_pictures_of_an_earlier_run_do_not_stay(self):
        disk(controller=True, period_s=1.0).write(self.folder)
        self.assertEqual(self.call_plot(only=("masses", "normal_force")), (0, ""))
        self.assertEqual(self.drawn(), {"masses", "normal_force"})
        disk(period_s=1.0).write(self.folder)
        self.assertEqual(self.call_plot(only=("masses", "normal_force")), (0, ""))
        self.assertEqual(self.drawn(), {"normal_force"})

    def test_words_do_not_cover_each_other(self):
        detaching, rolling = (self.recorded(make(controller=True)) for make in (detaching_ball, disk))
        for run in (self.flying(), detaching, rolling):
            for name, draw in pictures.PICTURES.items():
                figure = draw(run)
                if figure is not None:
                    with self.subTest(scenario=run.name, picture=name):
                        assert_words_apart(self, figure)

    def test_straight_path_is_drawn_against_time(self):
        run = self.recorded(disk())
        axes = pictures.path(run).axes[0]
        self.assertEqual((axes.get_xlabel(), axes.get_ylabel()), ("$t$ [s]", "$z_1$ [m]"))
        time, distance = self.line(axes, pictures.BLUE)
        reference = read_reference("paper_disk")
        np.testing.assert_allclose(time, reference["t"], rtol=0, atol=1e-12)
        np.testing.assert_allclose(distance, reference["z_1"], rtol=0, atol=1e-11)

    def test_straight_path_in_any_direction(self):
        run = self.recorded(disk(turn_rad=0.7))
        axes = pictures.path(run).axes[0]
        self.assertEqual(axes.get_ylabel(), "distance along (0.765, 0.644) [m]")
        # Turning the plane keeps distances; 1e-9 leaves room for the rounding of the turn and of the fitted direction.
        distance = self.line(axes, pictures.BLUE)[1]
        np.testing.assert_allclose(distance, read_reference("paper_disk")["z_1"], rtol=0, atol=1e-9)

    def test_path_has_equal_axes_and_shows_all_of_it(self):
        run = self.recorded(ball())
        figure = pictures.path(run)
        figure.savefig(io.BytesIO(), dpi=50)
        axes = figure.axes[0]
        box = axes.get_window_extent()
        width, height = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
        # A pixel of the box's rounding on several hundred.
        self.assertAlmostEqual(box.width / width / (box.height / height), 1.0, delta=0.01)
        z = run.state["position_W_m"]
        self.assertTrue(axes.get_xlim()[0] < z[:, 0].min() and z[:, 0].max() < axes.get_xlim()[1])
        self.assertTrue(axes.get_ylim()[0] < z[:, 1].min() and z[:, 1].max() < axes.get_ylim()[1])

    PATCHES = """
[surface]
static_friction = 0.5
[[surface.patch]]
polygon = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
static_friction = 0.1
[[surface.patch]]
circle = { center = [1, 0], radius = 0.4 }
rolling_resistance = 0.05
[[surface.patch]]
circle = { center = [500, 0], radius = 0.4 }
static_friction = 0.9
"""

    def test_path_shows_the_patches_in_view(self):
        for synthetic in (ball(), disk()):
            folder = synthetic.write(self.folder)
            (self.folder / "scenario.toml").write_text(self.PATCHES)
            run = RecordedRun(folder)
            self.assertEqual(len(run.patches), 3)
            self.assertEqual([patch.kind for patch in run.patches], ["slippery", "resists", "rough"])
            self.assertEqual(run.patches[1].text, "c_rr 0.05")
            figure = pictures.path(run)
            said = self.texts(figure)
            self.assertIn("less friction than the floor", said)
            self.assertNotIn("more friction than the floor", said)
            figure.savefig(io.BytesIO(), dpi=50)
            box = figure.axes[0]
            self.assertLess(np.ptp(box.get_xlim()), 100)  # the patch far away widens nothing
        places = np.array([[0, 0], [1, 0], [0.55, 0.3], [500, 0]])
        np.testing.assert_array_equal(floor_patches.top_patch(run.patches, places), [0, 1, -1, 2])
        # Where they overlap the last one counts.
        np.testing.assert_array_equal(floor_patches.top_patch(run.patches[:2], np.array([[0.65, 0], [0.45, 0]])), [1, 0])

    def test_friction_needed_beside_what_the_floor_under_the_ball_gives(self):
        folder = ball().write(self.folder)
        (self.folder / "scenario.toml").write_text(self.PATCHES)
        run = RecordedRun(folder)
        floor = run.static_friction_coefficient
        under = run.static_friction_under_ball()
        inside = (np.abs(run.state["position_W_m"][:, :2]) <= 0.5).all(axis=1)  # of the first patch
        self.assertTrue(inside.any())
        np.testing.assert_array_equal(under[inside & ~run.patches[1].holds(run.state["position_W_m"][:, :2])], 0.1)
        np.testing.assert_array_equal(under[~inside], floor)
        self.assertIn("under the ball: 0.1 to 0.35", self.texts(pictures.friction_required(run)))
        (self.folder / "scenario.toml").write_text("")
        self.assertIsNone(RecordedRun(folder).static_friction_under_ball())

    def test_words_on_a_patch_at_the_side_stay_in_the_axes(self):
        folder = ball().write(self.folder)
        high = RecordedRun(folder).state["position_W_m"][:, :2].max(axis=0)
        (self.folder / "scenario.toml").write_text(
            "[surface]\nstatic_friction = 0.5\n[[surface.patch]]\n"
            f"circle = {{ center = [{high[0] + 1}, {high[1]}], radius = 1.0 }}\n"
            "static_friction = 0.123\nrolling_resistance = 0.0123\n")
        figure = pictures.path(RecordedRun(folder))
        figure.savefig(io.BytesIO())
        axes = figure.axes[0]
        note = next(text for text in axes.texts if "0.123" in text.get_text())
        words, view = note.get_window_extent(), axes.get_window_extent()
        # Setting the axes' size comes after, and moves them by less than the margin of 1 %.
        self.assertGreaterEqual(words.x0, view.x0)
        self.assertLessEqual(words.x1, view.x1)

    def test_a_constant_has_ticks_that_differ(self):
        for value, extent in ((9.81, 1e-11), (9.81, 0), (-3.0, 1e-6)):
            axes = Figure().subplots()
            axes.plot([0, 1], [value, value + extent])
            axes.set_ylim(value - 1e-9, value + 1e-9 + extent)
            page.widen_flat(axes)
            self.assertAlmostEqual(np.ptp(axes.get_ylim()), 0.2 * abs(value), delta=1e-3)
        axes = Figure().subplots()
        axes.plot([0, 1], [9.81, 9.82])
        before = axes.get_ylim()
        page.widen_flat(axes)
        self.assertEqual(axes.get_ylim(), before)

    def test_patches_that_cannot_be_read_are_none(self):
        for text in ("[surface", "surface = 3", "[[surface.patch]]\npolygon = 'x'", "[[surface.patch]]\n"):
            (self.folder.parent / "scenario.toml").write_text(text)
            self.assertEqual(floor_patches.read_patches(self.folder.parent), [])

    def test_friction_arrows_point_along_the_force(self):
        run = self.recorded(ball())
        quiver, = pictures.path(run).axes[0].findobj(Quiver)
        z = np.asarray(run.state["position_W_m"][:, :2], dtype=float)
        force = np.asarray(run.contact["friction_force_W_n"], dtype=float)
        self.assertGreater(len(quiver.X), 20)
        for x, y, u, v in zip(quiver.X, quiver.Y, quiver.U, quiver.V):
            row = int(np.argmin(np.hypot(z[:, 0] - x, z[:, 1] - y)))
            f = force[row] / np.hypot(*force[row])
            # The arrow is the force times one positive number: rounding only.
            np.testing.assert_allclose(np.array([u, v]) / math.hypot(u, v), f, rtol=0, atol=1e-9)

    def test_body_frame_of_a_disk_is_its_plane(self):
        axes = pictures.body_frame(self.recorded(disk())).axes[0]
        self.assertEqual((axes.get_xlabel(), axes.get_ylabel()), ("$E_1$ [m]", "$E_3$ [m]"))
        x, y = self.line(axes, pictures.MASS_COLORS[0])
        np.testing.assert_allclose(np.hypot(x, y), 0.9, rtol=1e-12)  # its rail is this circle: rounding only

    def test_body_frame_of_a_ball_is_spatial(self):
        figure = pictures.body_frame(self.recorded(ball()))
        self.assertEqual(figure.axes[0].name, "3d")
        self.assertIn("mass 2", self.texts(figure))

    def test_radius_is_found_from_rolling(self):
        # The synthetic velocity is exactly that of a ball of radius 1; rounding only.
        self.assertAlmostEqual(self.recorded(ball()).ball_radius_m(), 1.0, delta=1e-12)

    def test_ball_at_rest_is_drawn(self):
        run = self.recorded(ball(period_s=1.0))
        run.state = run.state.copy()
        for name in ("position_W_m", "velocity_W_mps", "angular_velocity_B_radps"):
            run.state[name][:] = 0
        run.contact = run.contact.copy()
        for name in ("friction_force_W_n", "static_friction_n", "mu_required"):
            run.contact[name][:] = 0
        self.assertIsNone(run.ball_radius_m())
        for name, draw in pictures.PICTURES.items():
            with self.subTest(picture=name):
                figure = draw(run)
                if figure is not None:
                    figure.savefig(io.BytesIO())

    def test_commanded_minus_true_is_what_the_controller_said(self):
        run = self.recorded(ball(controller=True))
        time, commanded, true = run.commanded_and_true()
        for i in range(3):
            # The ringing that synthetic_run.py adds; theta is below 10, so subtracting leaves 1e-14.
            offset = 2e-3 * (i + 1) * np.sin(5 * time + i)
            np.testing.assert_allclose(commanded[:, i] - true[:, i], offset, rtol=0, atol=1e-14)
        difference = self.line(pictures.masses(run).axes[1], pictures.MASS_COLORS[2])[1]
        np.testing.assert_allclose(difference, true[:, 2] - commanded[:, 2], rtol=0, atol=0)

    def test_last_sample_between_ticks_has_no_command(self):
        run = self.recorded(detaching_ball(controller=True))
        self.assertEqual(run.state["time_s"][-1], run.end_s)
        self.assertLess(run.commanded_and_true()[0][-1], run.end_s - 1e-3)
        self.assertLess(run.commanded_contact()[0][-1], run.end_s - 1e-3)

    def test_motor_share_is_real_less_commanded(self):
        synthetic = ball(controller=True)
        synthetic.summary["motor_share"] = {
            "normal_force": {"difference": -0.12, "time": 3.5, "real": 4.0, "commanded": 4.12},
            "static_friction": {"difference": None, "time": 2.5, "real": None, "commanded": 1.0},
        }
        run = self.recorded(synthetic)
        figure = pictures.motor_share(run)
        time = run.contact["time_s"]
        shake = 0.125 * np.sin(9 * time)
        for row, (real, difference) in enumerate(((run.contact["normal_force_n"], -shake),
                                                  (run.contact["static_friction_n"], -np.abs(shake) / 2))):
            left, right = figure.axes[2 * row], figure.axes[2 * row + 1]
            for axes, color, expected in ((left, pictures.VERMILLION, real), (left, pictures.BLUE, real - difference),
                                          (right, pictures.BLACK, difference)):
                drawn_time, drawn = self.line(axes, color)
                np.testing.assert_allclose(drawn_time, time, rtol=0, atol=1e-12)
                np.testing.assert_allclose(drawn, expected, rtol=0, atol=1e-12)  # forces of a few N: rounding only
        said = self.texts(figure)
        self.assertIn("furthest apart -0.12 at $t$ = 3.5 s", said)
        self.assertNotIn("2.5000", said)

    def test_motor_share_leaves_out_where_the_ball_does_not_roll(self):
        synthetic = ball(controller=True)
        run = self.recorded(synthetic)
        run.contact = run.contact.copy()
        run.contact["regime"][50:60] = 1
        time, value = self.line(pictures.motor_share(run).axes[0], pictures.BLUE)
        self.assertEqual(np.count_nonzero(np.isnan(value)), 1)  # the line is broken there
        self.assertFalse(np.isin(run.contact["time_s"][50:60], time[np.isfinite(value)]).any())
        run.contact["regime"][:] = 2
        self.assertIsNone(pictures.motor_share(run))

    def test_motor_share_stays_readable_where_the_ratio_grows_without_bound(self):
        run = self.recorded(ball(controller=True))
        run.contact = run.contact.copy()
        run.contact["mu_required"][100] = 1e3
        run.contact["mu_required"][101] = math.inf
        run.summary["motor_share"] = {"mu_required": {"difference": 1e3, "time": 10.0}}
        figure = pictures.motor_share(run)
        self.assertLess(figure.axes[4].get_ylim()[1], 2)
        self.assertIn("off this axis", self.texts(figure))

    def test_cut_off_log_is_drawn_and_said(self):
        ball().write(self.folder)
        log = self.folder / "run.lcmlog"
        log.write_bytes(log.read_bytes()[:log.stat().st_size // 2])
        status, said = self.call_plot(only=("path",))
        self.assertEqual(status, 0)
        self.assertRegex(said, r"run\.lcmlog: cut off inside an event at byte \d+; drew what comes before")
        self.assertEqual(self.drawn(), {"path"})
        self.assertLess(RecordedRun(self.folder).end_s, 11)

    def test_what_cannot_be_drawn_is_said(self):
        self.assertEqual(self.call_plot()[0], 2)
        ball(period_s=1.0).write(self.folder)
        summary, log = self.folder / "summary.json", self.folder / "run.lcmlog"
        summary.write_text("{")
        self.assertRegex(self.call_plot()[1], r"summary\.json: not valid JSON")
        summary.unlink()
        self.assertRegex(self.call_plot()[1], r"summary\.json: No such file")
        summary.write_text("{}")
        log.write_bytes(log.read_bytes()[:100])
        self.assertRegex(self.call_plot()[1], r"no BALLAST_\w+ message")
        log.unlink()
        status, said = self.call_plot()
        self.assertRegex(said, r"run\.lcmlog: No such file")
        self.assertEqual(status, 2)

    def test_wrong_fingerprint_names_the_channel(self):
        synthetic = ball(period_s=1.0)
        fingerprint = synthetic.events[0][28 + len("BALLAST_CONTACT"):][:8]
        synthetic.events[0] = synthetic.events[0].replace(fingerprint, b"\x01" * 8)
        synthetic.write(self.folder)
        with self.assertRaisesRegex(LogError, "BALLAST_CONTACT, message 0: not a contact_t"):
            RecordedRun(self.folder)

    def test_a_ringing_signal_is_its_mean_and_a_band(self):
        time = np.arange(30000) / 1000
        swing = np.where(time < 20, np.sin(2 * np.pi * 97 * time), 0)
        _, (axes,) = page.blank_page((9, 5))
        self.assertTrue(page.draw_ringing(axes, time, time + swing, page.BLUE, 1.0))
        line, = axes.get_lines()
        # A block of 0.1 s has 9.7 periods; the rest of a period leaves at most 1 / (9.7 pi) in the mean.
        np.testing.assert_allclose(line.get_ydata()[200:19800], time[200:19800], rtol=0, atol=0.04)
        np.testing.assert_array_equal(line.get_ydata()[20000:], time[20000:])  # drawn as it is where it does not ring
        band = axes.collections[0].get_paths()[0].vertices
        self.assertLess(band[:, 0].max(), 20.2)
        self.assertGreater(np.ptp(band[(band[:, 0] > 5) & (band[:, 0] < 5.35), 1]), 1.9)
        self.assertFalse(page.draw_ringing(axes, time, np.sin(time), page.BLUE, 1.0))

    def test_eight_masses_have_eight_colors(self):
        self.assertEqual(len(set(pictures.MASS_COLORS)), 8)


if __name__ == "__main__":
    unittest.main()
