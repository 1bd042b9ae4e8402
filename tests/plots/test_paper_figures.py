"""The figures of the paper's simulations: that all are there, in the paper's grouping, and show the runs."""

import contextlib
import io
import re
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
from matplotlib.image import imread
from matplotlib.legend import Legend
from matplotlib.quiver import Quiver

import paper_figures
from event_log import LogError
from layout import assert_words_apart
from page import BLACK, BLUE, GREEN, MASS_COLORS, VERMILLION
from synthetic_run import BALL_RAILS, DISK_RAILS, ball, detaching_ball, disk, read_reference

SCENARIOS_DIR = Path(__file__).resolve().parents[2] / "sim" / "scenarios"
# The labels in the paper's two sections of numerical simulations: figures, and of each its panels in their order.
THE_PAPERS = {
    "fig_abs_ui": ["fig_abs_ui"],
    "fig_disk_masses_rails_bf_gc": ["fig_disk_masses_rails_bf_gc"],
    "fig_disk_ode_sims": ["fig_disk_cm_time_bf_gc", "fig_disk_cm_time_spatial_gc", "fig_disk_dot_angle", "fig_disk_gc"],
    "fig_disk_ode_sims_cp_forces": ["fig_disk_normal", "fig_disk_sf", "fig_disk_coeff_sf"],
    "fig_ball_masses_rail_bf_gc": ["fig_ball_masses_rail_bf_gc"],
    "fig_ball_dae_sims": ["fig_ball_cm_bf_gc", "fig_ball_cm_spatial_gc", "fig_ball_Omega", "fig_ball_gc_path"],
    "fig_ball_dae_sims_cp_forces": ["fig_ball_normal", "fig_ball_mag_sf", "fig_ball_coeff_sf", "fig_ball_sf_sparse"],
    "fig_ball_ode_sims_detach": ["fig_dball_normal", "fig_dball_mag_sf", "fig_dball_Omega", "fig_dball_sf_sparse"],
}


class PaperFiguresTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.runs_dir = Path(folder.name)
        for name, make in (("paper_disk", disk), ("paper_ball", ball), ("paper_detach", detaching_ball)):
            make().write(cls.runs_dir / name)
        cls.paper_runs = {name: paper_figures.PaperRun(cls.runs_dir, SCENARIOS_DIR, name)
                          for name in paper_figures.SCENARIOS}

    def drawn(self, label):
        figure, = [figure for figure in paper_figures.FIGURES if figure.label == label]
        return paper_figures.draw_figure(figure, self.paper_runs[figure.scenario])

    def panel_axes(self, label):
        """The axes with the data of each panel, in their order; in space, a flat frame carries the legend."""
        return [axes for axes in self.drawn(label).axes if axes.axison or axes.name == "3d"]

    @staticmethod
    def line(axes, color, style="-"):
        """The longest line of that colour, as an array of points."""
        lines = [line for line in axes.get_lines() if line.get_color() == color and line.get_linestyle() == style]
        longest = max(lines, key=lambda line: len(line.get_data()[0]))
        return np.array(longest.get_data_3d() if axes.name == "3d" else longest.get_data()).T

    @staticmethod
    def said(axes):
        return "\n".join(text.get_text() for legend in axes.findobj(Legend) for text in legend.get_texts())

    def call(self, runs_dir, out_dir):
        stdout, stderr = io.StringIO(), io.StringIO()
        arguments = mock.patch.object(sys, "argv", ["x", str(runs_dir), str(SCENARIOS_DIR), str(out_dir)])
        with arguments, contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
            return paper_figures.main(), stdout.getvalue(), stderr.getvalue()

    def test_figures_and_panels_are_the_papers(self):
        ours = {figure.label: [panel.label for panel in figure.panels] for figure in paper_figures.FIGURES}
        self.assertEqual(ours, THE_PAPERS)
        self.assertEqual(list(ours), list(THE_PAPERS))

    def test_every_panel_has_its_place_in_the_papers_grid(self):
        for label, panels in THE_PAPERS.items():
            with self.subTest(figure=label):
                figure = self.drawn(label)
                axes = [axes for axes in figure.axes if axes.axison or axes.name == "3d"]
                self.assertEqual(len(axes), len(panels))
                centers = np.array([0.5 * np.sum(one.get_position().get_points(), axis=0) for one in axes])
                if len(panels) == 1:
                    continue
                # Two side by side, the next row lower, a last one alone in the middle of the page.
                self.assertLess(centers[0, 0], 0.5)
                self.assertGreater(centers[1, 0], 0.5)
                self.assertLess(centers[2:, 1].max(), centers[:2, 1].min())
                if len(panels) == 3:
                    self.assertAlmostEqual(centers[2, 0], 0.5, delta=0.05)
                captions = [text.get_text()[:3] for text in figure.texts if text.get_text().startswith("(")]
                self.assertEqual(captions, ["(a)", "(b)", "(c)", "(d)"][:len(panels)])

    def test_words_do_not_cover_each_other(self):
        for label in THE_PAPERS:
            with self.subTest(figure=label):
                assert_words_apart(self, self.drawn(label))

    def test_acceleration_is_that_of_the_equation(self):
        axes, = self.panel_axes("fig_abs_ui")
        for i in range(4):
            # eq_prescribed_u_disk in the middle of the ticks of 0.1; velocities to 1e-16 over such a tick leave 1e-14.
            points = self.line(axes, MASS_COLORS[i])
            np.testing.assert_allclose(points[:, 0], 0.1 * np.arange(len(points)) + 0.05, rtol=0, atol=1e-12)
            np.testing.assert_allclose(points[:2, 1], [1.0, 0.5], rtol=0, atol=1e-12)
            np.testing.assert_allclose(points[2:, 1], 0, rtol=0, atol=1e-12)
        # The one figure stands for the ball too: eq_prescribed_u_ball.
        _, of_the_ball = self.paper_runs["paper_ball"].acceleration()
        for i in range(3):
            np.testing.assert_allclose(of_the_ball[:, i], points[:, 1], rtol=0, atol=1e-12)

    def test_disk_trajectories(self):
        reference = read_reference("paper_disk")
        body, space, *_ = self.panel_axes("fig_disk_ode_sims")
        phi = -reference["z_1"]  # rolling: z = -r phi
        for axes, turn in ((body, 0), (space, phi)):
            moments = np.zeros((len(phi), 2))
            for i, (radius, _, _) in enumerate(DISK_RAILS):
                angle = reference[f"theta_{i + 1}"] + turn
                expected = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
                moments += expected
                points = self.line(axes, MASS_COLORS[i])
                np.testing.assert_allclose(points[:, 0], reference["t"], rtol=0, atol=1e-12)
                # The reference's digits: 1e-10 in its state.
                np.testing.assert_allclose(points[:, 1:], expected, rtol=0, atol=1e-9)
            np.testing.assert_allclose(self.line(axes, BLACK)[:, 1:], moments / 5, rtol=0, atol=1e-9)

    def test_disk_rate_and_path(self):
        reference = read_reference("paper_disk")
        _, _, rate, path = self.panel_axes("fig_disk_ode_sims")
        np.testing.assert_allclose(self.line(rate, BLUE)[:, 1], -reference["Omega_2"], rtol=0, atol=1e-12)
        np.testing.assert_allclose(self.line(path, BLUE)[:, 1], reference["z_1"], rtol=0, atol=1e-12)
        # phi-dot is -zdot / r: a central difference over 0.2 where third derivatives stay below 1 is good to 1e-2.
        zdot = np.gradient(reference["z_1"], reference["t"])
        np.testing.assert_allclose(self.line(rate, BLUE)[1:-1, 1], -zdot[1:-1], rtol=0, atol=1e-2)

    def test_forces(self):
        for label, name in (("fig_disk_ode_sims_cp_forces", "paper_disk"),
                            ("fig_ball_dae_sims_cp_forces", "paper_ball")):
            reference = read_reference(name)
            magnitude = np.hypot(reference["f_1"], reference["f_2"])
            expected = [reference["N"], reference["f_1"] if name == "paper_disk" else magnitude,
                        magnitude / reference["N"]]
            for axes, value in zip(self.panel_axes(label), expected):
                with self.subTest(figure=label, axis=axes.get_ylabel()):
                    # Resampling at the reference's own times and the quotient: rounding only.
                    np.testing.assert_allclose(self.line(axes, BLUE)[:, 1], value, rtol=1e-9, atol=1e-12)

    def test_published_numbers_stand_beside_ours(self):
        for label, published in (("fig_disk_ode_sims_cp_forces", 0.2951), ("fig_ball_dae_sims_cp_forces", 0.19)):
            axes = self.panel_axes(label)[2]
            level, = [line for line in axes.get_lines() if line.get_linestyle() == "--"]
            self.assertEqual(list(level.get_ydata()), [published] * 2)
            self.assertIn(f"the paper: {published}", self.said(axes))
        axes = self.panel_axes("fig_ball_ode_sims_detach")[0]
        upright, = [line for line in axes.get_lines() if line.get_linestyle() == "--"]
        self.assertEqual(list(upright.get_xdata()), [3.7358] * 2)
        self.assertGreater(axes.get_xlim()[1], 3.7358)
        self.assertIn("$N$ = 0 at $t$ = 3.61 s", self.said(axes))

    def test_ball_trajectories_in_space(self):
        body, space, *_ = self.panel_axes("fig_ball_dae_sims")
        reference = read_reference("paper_ball")
        q0, q = reference["q_w"][:, None], np.stack([reference[key] for key in ("q_x", "q_y", "q_z")], axis=1)
        for i in range(3):
            in_body, in_space = self.line(body, MASS_COLORS[i]), self.line(space, MASS_COLORS[i])
            # A versor turns v into v + 2 q0 (q x v) + 2 q x (q x v).
            turned = np.cross(q, in_body)
            turned = in_body + 2 * q0 * turned + 2 * np.cross(q, turned)
            # The reference's versors are of unit length to 1e-11.
            np.testing.assert_allclose(in_space, turned, rtol=0, atol=1e-9)
            np.testing.assert_allclose(np.linalg.norm(in_body, axis=1), BALL_RAILS[i][0], rtol=1e-12)

    def test_body_angular_velocity(self):
        for label, name in (("fig_ball_dae_sims", "paper_ball"), ("fig_ball_ode_sims_detach", "paper_detach")):
            reference = read_reference(name)
            axes = self.panel_axes(label)[2]
            for j, (color, style) in enumerate(((BLUE, "-"), (VERMILLION, "--"), (GREEN, "-.")), start=1):
                rate = self.line(axes, color, style)[:, 1]
                np.testing.assert_allclose(rate, reference[f"Omega_{j}"], rtol=0, atol=1e-12)
            self.assertEqual(re.findall(r"Omega_\d", self.said(axes)), ["Omega_1", "Omega_2", "Omega_3"])

    def test_paths(self):
        for label, name in (("fig_ball_dae_sims", "paper_ball"), ("fig_ball_dae_sims_cp_forces", "paper_ball"),
                            ("fig_ball_ode_sims_detach", "paper_detach")):
            reference = read_reference(name)
            axes = self.panel_axes(label)[3]
            expected = np.stack([reference["z_1"], reference["z_2"]], axis=1)
            np.testing.assert_allclose(self.line(axes, BLUE), expected, rtol=0, atol=1e-11)
            self.assertEqual(len(axes.findobj(Quiver)), 0 if label == "fig_ball_dae_sims" else 1)

    def test_friction_on_the_path_is_the_force_there(self):
        reference = read_reference("paper_ball")
        quiver, = self.panel_axes("fig_ball_dae_sims_cp_forces")[3].findobj(Quiver)
        z = np.stack([reference["z_1"], reference["z_2"]], axis=1)
        rows = [int(np.argmin(np.hypot(z[:, 0] - x, z[:, 1] - y))) for x, y in zip(quiver.X, quiver.Y)]
        force = np.stack([reference["f_1"], reference["f_2"]], axis=1)[rows]
        scale = np.hypot(quiver.U, quiver.V) / np.hypot(*force.T)
        np.testing.assert_allclose(scale, scale[0], rtol=1e-9)  # one scale for all: rounding only
        np.testing.assert_allclose(quiver.U, scale * force[:, 0], rtol=0, atol=1e-9)

    def test_rails_are_found_from_the_way_of_the_masses(self):
        for name, rails in (("paper_disk", DISK_RAILS), ("paper_ball", BALL_RAILS)):
            for circle, (radius, cos, sin) in zip(self.paper_runs[name].rail_circles_B_m(count=7), rails):
                turn = np.linspace(0, 2 * np.pi, 7)[:, None]
                # A fit without noise over three radians of way: rounding, some ten times larger.
                expected = radius * (np.cos(turn) * np.array(cos) + np.sin(turn) * np.array(sin))
                np.testing.assert_allclose(circle, expected, rtol=0, atol=1e-12)

    def test_configuration_is_that_of_the_start(self):
        flat, = self.panel_axes("fig_disk_masses_rails_bf_gc")
        dots = [line for line in flat.get_lines() if line.get_marker() == "o"]
        np.testing.assert_allclose([line.get_xydata()[0] for line in dots], [(0, -r) for r, _, _ in DISK_RAILS],
                                   rtol=0, atol=1e-12)
        space, = self.panel_axes("fig_ball_masses_rail_bf_gc")
        shell, = [line for line in space.get_lines() if line.get_marker() == "s"]
        np.testing.assert_array_equal(np.ravel(shell.get_data_3d()), (0, 0, -0.05))  # zeta_0 of the paper's ball

    def test_files_and_report(self):
        out_dir = self.runs_dir / "out"
        status, said, complained = self.call(self.runs_dir, out_dir)
        self.assertEqual((status, complained), (0, ""))
        self.assertEqual({path.name for path in out_dir.iterdir()}, {f"{label}.png" for label in THE_PAPERS})
        for path in out_dir.iterdir():
            image = imread(path)[:, :, :3]
            self.assertEqual(image.shape[1], 1500)
            self.assertGreater(np.mean(np.any(image < 0.9, axis=2)), 1e-3, path.name)
        for label, panels in THE_PAPERS.items():
            self.assertIn(label, said)
            for panel in panels:
                self.assertIn(panel, said)
        # The reference at its samples, every 0.1: below the maximum between them, to three digits the same.
        self.assertRegex(said, r"fig_disk_coeff_sf +most f_s/N +0\.295\d* +0\.2951\n")
        self.assertRegex(said, r"fig_ball_coeff_sf +most f_s/N +0\.190\d* +0\.19\n")
        self.assertRegex(said, r"fig_dball_normal +N = 0 at t +3\.61 +3\.7358\n")

    def test_the_same_runs_give_the_same_bytes(self):
        figure, = [figure for figure in paper_figures.FIGURES if figure.label == "fig_ball_dae_sims"]
        pages = []
        for _ in range(2):
            page = io.BytesIO()
            paper_figures.draw_figure(figure, self.paper_runs["paper_ball"]).savefig(page, dpi=50)
            pages.append(page.getvalue())
        self.assertEqual(pages[0], pages[1])

    def test_other_runs_are_refused(self):
        def refused(synthetic, pattern, name="paper_ball"):
            with tempfile.TemporaryDirectory() as folder:
                synthetic.write(Path(folder) / name)
                for other in ("paper_disk", "paper_ball", "paper_detach"):
                    if other != name:
                        (Path(folder) / other).symlink_to(self.runs_dir / other)
                status, said, complained = self.call(folder, Path(folder) / "out")
                self.assertEqual((status, said), (2, ""))
                self.assertRegex(complained, pattern)
                self.assertFalse((Path(folder) / "out").exists())

        refused(ball(controller=True, period_s=1.0), r"paper_ball/summary\.json: steppers drive the masses")
        unpublished = ball(period_s=1.0)
        unpublished.summary["published"] = []
        refused(unpublished, r"paper_ball/summary\.json: published has no mu_required\.max")
        completed = detaching_ball(period_s=1.0)
        completed.summary["end"]["reason"] = "completed"
        refused(completed, r"end\.reason is completed; this figure needs a run that detached", "paper_detach")
        cut = ball(period_s=1.0)
        cut.events[-1] = cut.events[-1][:-1]
        refused(cut, r"paper_ball/run\.lcmlog: cut off inside an event at byte \d+")
        with self.assertRaisesRegex(LogError, r"nowhere/paper_ball\.toml: No such file"):
            paper_figures.PaperRun(self.runs_dir, Path("nowhere"), "paper_ball")


if __name__ == "__main__":
    unittest.main()
