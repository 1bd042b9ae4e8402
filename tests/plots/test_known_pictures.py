"""The robot's knowledge: errors, bands and flags are those of the messages, and the pictures show them."""

import io
import math
import tempfile
import unittest
import warnings
from pathlib import Path

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.legend import Legend

import known
import known_pictures
import pictures
import synthetic_run
from event_log import LogError
from known import governed_spans
from layout import assert_words_apart
from page import BLUE, GREEN, ORANGE
from recorded_run import RecordedRun
from synthetic_run import ball, believe


class KnownTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name) / "run"

    def recorded(self, scenario=None, belief=False, **options):
        run = ball(**{"known": True, **options})
        if belief:
            believe(run, self.folder)
        run.write(self.folder)
        if scenario is not None:
            (self.folder / "scenario.toml").write_text(scenario)
        return RecordedRun(self.folder)

    def test_a_run_without_an_estimate_has_none_of_it(self):
        for options in ({}, {"controller": True}):
            run = self.recorded(known=False, **options)
            for found in (run.estimate, run.measured, run.predicted, known_pictures.estimate(run),
                          known_pictures.belief(run)):
                self.assertIsNone(found)
            self.assertFalse(run.commands_as_believed)

    def test_errors_are_those_put_in(self):
        found = self.recorded().estimate
        time = found.time_s
        # Angles come back through quaternions of doubles.
        for track, expected in ((found.tilt_deg, synthetic_run.tilt_error_deg), (found.place_error_m, synthetic_run.place_error_m)):
            np.testing.assert_allclose(track.error, [expected(t) for t in time], atol=1e-9)
        np.testing.assert_allclose(found.yaw_deg.error[:, 0], [synthetic_run.yaw_error_deg(t) for t in time], atol=1e-9)
        # A constant bias is its own mean.
        np.testing.assert_allclose(found.bias_degps.truth, np.tile(synthetic_run.GYRO_BIAS_DEGPS, (len(time), 1)), atol=1e-9)
        np.testing.assert_allclose(found.bias_degps.error, [synthetic_run.bias_error_degps(t) for t in time], atol=1e-9)
        for track, name in ((found.tilt_deg, "tilt"), (found.yaw_deg, "yaw"), (found.bias_degps, "bias"), (found.place_m, "place")):
            np.testing.assert_allclose(track.sigma, synthetic_run.KNOWN_SIGMA[name], rtol=1e-12)

    def test_numbers_of_a_track(self):
        found = self.recorded().estimate
        # Yaw: 0.3 degrees/s for 20 s, a band of 2 sigma = 4 degrees, which it leaves after 13.33 s.
        self.assertAlmostEqual(found.yaw_deg.largest(), 6, delta=1e-9)
        self.assertAlmostEqual(found.yaw_deg.rms(), 6 / math.sqrt(3), delta=0.02)
        self.assertAlmostEqual(found.yaw_deg.inside(), 134 / 201, delta=1e-9)
        self.assertEqual(found.tilt_deg.inside(), 1)

    def test_samples_that_come_late_and_rarely_have_the_same_mean(self):
        """The true bias where the IMU has a sample in every third tick only, which arrives a tick late."""
        run = self.recorded()
        expected = run.estimate.bias_degps.truth
        synthetic = ball(known=True, imu_every=3, imu_late=1)
        late = RecordedRun(synthetic.write(self.folder)).estimate.bias_degps.truth
        # The bias is constant, so every mean of it is the same.
        np.testing.assert_allclose(late, expected, atol=1e-9)

    def test_tilt_is_that_of_gravity(self):
        up = np.array([[1.0, 0, 0, 0]])
        level = np.array([0.0, 0, -1])
        turned = np.array([synthetic_run.quaternion((0, 0, 0.7))])
        # A turn about the vertical tilts nothing on a level floor, and is all of the yaw.
        np.testing.assert_allclose(known.tilt_error_rad(turned, up, level, level), 0, atol=1e-15)
        self.assertAlmostEqual(known.yaw_error_rad(turned, up)[0], 0.7, delta=1e-12)
        # A slope that nobody knows of: the estimate, which has gravity right, is then off against the floor only.
        tilted = np.array([synthetic_run.quaternion((0, 0.1, 0))])
        slope = np.array([math.sin(0.1), 0, -math.cos(0.1)])
        np.testing.assert_allclose(known.tilt_error_rad(tilted, up, known.rotated(tilted, slope[None])[0], slope), 0, atol=1e-15)
        # Large errors too: half a turn at most.
        over = np.array([synthetic_run.quaternion((3.0, 0, 0))])
        np.testing.assert_allclose(known.tilt_error_rad(over, up, level, level), [[3.0, 0]], atol=1e-12)

    def test_the_believed_slope_is_read(self):
        scenario = "[surface]\nslope = { angle = 0.1, downhill = 0.5 }\n[believed.surface]\nslope = { angle = 0.0 }\n"
        found = self.recorded(scenario).estimate
        # The controller takes the floor for level, so its gravity is off by the slope, but for the errors put in.
        size = np.radians(np.linalg.norm(found.tilt_deg.error, axis=1))
        self.assertLess(abs(np.median(size) - 0.1), math.radians(0.3))

    def test_invalid_ticks_are_left_out(self):
        run = self.recorded()
        run.status = run.status.copy()
        run.status["estimate_valid"][:10] = 0
        run.status["measured_valid"][:20] = 0
        run.status["measured_mu_required"][30] = math.inf
        self.assertFalse(run.estimate.tilt_deg.known[:10].any())
        self.assertTrue(run.estimate.tilt_deg.known[10:].all())
        self.assertFalse(run.measured.need.known[:20].any())
        self.assertFalse(run.measured.need.known[30])

    def test_the_governors_strips_are_where_it_bent_and_their_shares_those_of_the_summary(self):
        run = self.recorded(controller=True)
        self.assertEqual(governed_spans(run), ([], []))
        run.status = run.status.copy()
        run.status["command_bent"][:] = (run.status["tick"] >= 20) & (run.status["tick"] < 30)
        run.status["backup_active"][:] = (run.status["tick"] >= 25) & (run.status["tick"] < 30)
        run.summary["governor"] = {"bent": 0.25, "backup": 0.125}
        period_s = run.summary["control_period"]
        bent, backup = governed_spans(run)
        # A command is of the tick after its status.
        np.testing.assert_allclose(bent, [(21 * period_s, 31 * period_s)])
        np.testing.assert_allclose(backup, [(26 * period_s, 31 * period_s)])
        names = [text.get_text() for legend in pictures.friction_required(run).findobj(Legend)
                 for text in legend.get_texts()]
        self.assertIn("bent by the governor 25 %", names)
        self.assertIn("on the backup 12 %", names)

    def test_flags_are_stretches(self):
        flags = self.recorded().measured.flags
        expected = [("slip", span) for span in synthetic_run.SLIP_FLAGS] + [("light", span) for span in synthetic_run.LIGHT_FLAGS]
        self.assertEqual([flag.what for flag in flags], [what for what, _ in expected])
        for flag, (_, (start, end)) in zip(flags, expected):
            self.assertAlmostEqual(flag.start_s, start, delta=1e-9)
            self.assertAlmostEqual(flag.end_s, end, delta=0.1)  # a tick

    def test_the_picture_has_truth_estimate_and_band(self):
        run = self.recorded(controller=True)
        figure = known_pictures.estimate(run)
        by_label = {axes.get_ylabel(): axes for axes in figure.axes}
        self.assertEqual(len(by_label), 10)
        lines = by_label["$N$ [N]"].get_lines()
        measured = next(line for line in lines if line.get_color() == GREEN)
        np.testing.assert_allclose(measured.get_ydata(), run.measured.normal_n.value[:, 0])
        band = by_label["$N$ [N]"].collections[0].get_paths()[0].get_extents()
        value = run.measured.normal_n.value
        self.assertAlmostEqual(band.ymax, value.max() + 2 * synthetic_run.KNOWN_SIGMA["normal"], delta=1e-9)
        path = by_label["$z_2$ [m]"]
        self.assertTrue(any(isinstance(found, PatchCollection) for found in path.collections))
        said = " ".join(text.get_text() for legend in figure.findobj(Legend) for text in legend.get_texts())
        self.assertIn("67 % inside", said)  # the yaw
        self.assertIn("slip flagged 2", said)
        assert_words_apart(self, figure)

    def test_a_wide_band_does_not_flatten_the_error(self):
        run = self.recorded()
        run.status = run.status.copy()
        run.status["yaw_sigma_rad"] = 3.0
        axes = next(axes for axes in known_pictures.estimate(run).axes if axes.get_ylabel().startswith("yaw"))
        low, high = axes.get_ylim()
        # 2.5 times the extent of the error, 6 degrees, on either side of it, and a margin of 6 %.
        self.assertLess(high - low, 6 * 6 * 1.121)

    def test_only_one_of_both(self):
        for off, panels in (("measured_valid", 5), ("estimate_valid", 5)):
            run = self.recorded()
            run.status = run.status.copy()
            run.status[off] = 0
            self.assertEqual(len(known_pictures.estimate(run).axes), panels)

    def test_shortest_runs_are_drawn_without_a_warning(self):
        for ticks in (1, 2):
            synthetic = ball(known=True)
            synthetic.events = synthetic.events[:4 * (2 + ticks)]
            synthetic.summary["end"]["time"] = 0.1 * (ticks - 1)
            run = RecordedRun(synthetic.write(self.folder))
            with self.subTest(ticks=ticks), warnings.catch_warnings():
                warnings.simplefilter("error")
                known_pictures.estimate(run).savefig(io.BytesIO(), dpi=30)

    def test_the_belief_is_drawn_beside_the_truth(self):
        run = self.recorded(known=False, belief=True)
        figure = known_pictures.belief(run)
        believed = next(line for line in figure.axes[0].get_lines() if line.get_color() == ORANGE)
        np.testing.assert_allclose(believed.get_ydata(), run.predicted.normal_n)
        real = next(line for line in figure.axes[3].get_lines() if line.get_color() == BLUE)
        np.testing.assert_allclose(real.get_xdata(), run.state["position_W_m"][:, 0])
        assert_words_apart(self, figure)

    def test_a_prediction_that_ends_early_is_not_continued(self):
        run = self.recorded(known=False, belief=True)
        place = run.predicted.place_at(np.array([0.0, 1e6]))
        self.assertTrue(np.isfinite(place[0]).all() and np.isnan(place[1]).all())

    def test_another_file_is_refused(self):
        run = self.recorded(known=False)
        for text in ("time_s,x\n1,2\n", synthetic_run.BELIEF_HEAD + "\n0,a,0,1,1,1\n"):
            (self.folder / "belief.csv").write_text(text)
            with self.subTest(text), self.assertRaises(LogError):
                known.read_predicted(self.folder)
        self.assertIsNotNone(run)

    def test_commanded_fields_of_the_tick_before_are_set_to_their_tick(self):
        run = self.recorded(controller=True)
        expected = run.commanded("normal_force_n")
        run.contact = run.contact.copy()
        for name in ("normal_force_n", "static_friction_n", "mu_required"):
            run.contact[f"commanded_{name}"] = np.concatenate([[np.nan], run.contact[f"commanded_{name}"][:-1]])
        run.contact["commanded_tick"] -= 1
        # The last tick's would have come with the next message.
        np.testing.assert_array_equal(run.commanded("normal_force_n")[:-1], expected[:-1])
        self.assertTrue(math.isnan(run.commanded("normal_force_n")[-1]))

    def test_the_motors_share_is_not_claimed_for_a_belief(self):
        run = self.recorded(controller=True)
        self.assertTrue(run.commands_as_believed)
        self.assertEqual(pictures.motor_share(run).axes[0].get_title(loc="left"), "Real less commanded, as the robot believes")


if __name__ == "__main__":
    unittest.main()
