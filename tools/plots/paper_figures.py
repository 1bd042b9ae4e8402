"""ballast-paper-figures RUNS_DIR SCENARIOS_DIR OUT_DIR: Draws the figures of the paper's numerical simulations.

RUNS_DIR holds the finished runs paper_disk, paper_ball and paper_detach with prescribed masses, as in the paper.
SCENARIOS_DIR holds their scenario files. Each figure of the paper becomes one picture, named by its label in the paper,
with the same panels in the same places, drawn from Ballast's runs alone. Colours, arrows and axis limits, which the
paper's captions leave open, are chosen here.
"""

import argparse
import math
import sys
import textwrap
import tomllib
from pathlib import Path
from typing import Callable, NamedTuple

import numpy as np
from matplotlib import ticker
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from event_log import LogError
from page import (BLACK, BLUE, GREEN, GREY, LIGHT_GREY, MASS_COLORS, VERMILLION, draw_sphere, finish_time_axis,
                  friction_arrows, hollow, legend_above, mark_ends, mark_extremum, rows_along, rows_over_time,
                  space_axes, time_text)
from recorded_run import RecordedRun
from short_number import significant

_WIDTH_PX = 1500
_CAPTION_LETTERS = 72  # per line below a panel
_ARROWS = 16


class PaperRun:
    """A finished run and its scenario."""

    def __init__(self, runs_dir, scenarios_dir, name):
        self.run = RecordedRun(Path(runs_dir) / name)
        path = Path(scenarios_dir) / f"{name}.toml"
        try:
            with open(path, "rb") as file:
                ball = tomllib.load(file)["ball"]
        except (OSError, ValueError, KeyError) as error:
            raise LogError(f"{path}: {getattr(error, 'strerror', None) or error}") from error
        self.radius_m = float(ball["radius"])
        self.shell_center_B_m = np.array(ball.get("center_of_mass", (0, 0, 0)), dtype=float)
        if self.run.is_stepper:
            raise LogError(f"{self.run.summary_path}: steppers drive the masses; the paper prescribes their motion")
        if self.run.damage:
            raise LogError(f"{Path(runs_dir) / name / 'run.lcmlog'}: {self.run.damage}")

    @property
    def time_s(self):
        return np.asarray(self.run.state["time_s"], dtype=float)

    def masses_B_m(self):
        """(samples, masses, 3): positions relative to the GC."""
        return np.asarray(self.run.state["mass_position_B_m"][:, :self.run.mass_count], dtype=float)

    def center_of_mass_B_m(self):
        """(samples, 3): the system's centre of mass relative to the GC."""
        return np.asarray(self.run.state["center_of_mass_B_m"], dtype=float)

    def to_space(self, vectors_B):
        """Rotates (samples, ..., 3) vectors from the body frame to the space frame by each sample's orientation."""
        w, x, y, z = np.asarray(self.run.state["orientation"], dtype=float).T
        rotation = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ])
        return np.einsum("jkn,n...k->n...j", rotation, vectors_B)

    def acceleration(self):
        """(time, theta'') in the middle of each tick, as the mean over the tick.

        The paper's theta'' is linear between kinks, and the kinks fall on ticks, so the two are equal.
        """
        time = self.time_s
        velocity = np.asarray(self.run.state["mass_velocity"][:, :self.run.mass_count], dtype=float)
        return 0.5 * (time[1:] + time[:-1]), np.diff(velocity, axis=0) / np.diff(time)[:, None]

    def rail_circles_B_m(self, count=181):
        """(count, 3) per mass: its whole rail, the circle center + cos(theta) a + sin(theta) b fitted to its path."""
        turn = np.linspace(0, 2 * np.pi, count)
        around = np.stack([np.ones_like(turn), np.cos(turn), np.sin(turn)], axis=1)
        circles = []
        for i in range(self.run.mass_count):
            theta = np.asarray(self.run.state["mass_position"][:, i], dtype=float)
            basis = np.stack([np.ones_like(theta), np.cos(theta), np.sin(theta)], axis=1)
            coefficients, _, _, _ = np.linalg.lstsq(basis, self.masses_B_m()[:, i], rcond=None)
            circles.append(around @ coefficients)
        return circles


class Panel(NamedTuple):
    label: str      # in the paper
    caption: str
    draw: Callable  # draw(figure, place, paper_run), `place` as for Figure.add_axes
    in_space: bool = False


class PaperFigure(NamedTuple):
    label: str       # in the paper; also the name of the file
    scenario: str
    title: str
    panels: tuple


def _over_time(figure, place, paper_run, label):
    axes = figure.add_axes(place)
    axes.set_ylabel(label)
    finish_time_axis(axes, paper_run.run)
    axes.xaxis.set_major_locator(ticker.MaxNLocator(6))
    return axes


def _mass_names(count):
    return [f"$m_{i + 1}$" for i in range(count)]


def _trajectory_legend(count):
    lines = [Line2D([], [], color=MASS_COLORS[i], linewidth=2, label=name) for i, name in enumerate(_mass_names(count))]
    return [lines, [Line2D([], [], color=BLACK, linewidth=1.2, label="CM of the system"),
                    Line2D([], [], label="start", **hollow(BLACK, 7))]]


def _trajectories(paper_run, rows, in_space_frame):
    """(points, colour, width) of each mass and, last and thin, of the system's centre of mass."""
    masses, center = paper_run.masses_B_m(), paper_run.center_of_mass_B_m()
    if in_space_frame:
        masses, center = paper_run.to_space(masses), paper_run.to_space(center)
    curves = [(masses[rows, i], MASS_COLORS[i], 2.0) for i in range(paper_run.run.mass_count)]
    return curves + [(center[rows], BLACK, 1.2)]


def _legend_over_space(figure, place, rows):
    inset = 0.08 * place[2]
    frame = figure.add_axes((place[0] + inset, place[1], place[2] - inset, place[3]), zorder=1)
    frame.axis("off")
    legend_above(frame, rows)


def _disk_trajectories(in_space_frame):
    letter = "e" if in_space_frame else "E"

    def draw(figure, place, paper_run):
        # The masses swing to and fro on their circles. Time as the third axis keeps the curves from overlapping.
        rows = rows_over_time(paper_run.run, 2000)
        time = paper_run.time_s[rows]
        axes = space_axes(figure, place, paper_run.radius_m, ("$t$ [s]", f"${letter}_1$ [m]", f"${letter}_3$ [m]"))
        axes.set_xlim(0, paper_run.run.end_s)
        axes.set_box_aspect((1.6, 1, 1), zoom=1.2)
        axes.view_init(elev=18, azim=-62)
        axes.tick_params(labelsize=11)
        axes.yaxis.set_major_locator(ticker.FixedLocator((-0.8, 0, 0.8)))
        axes.zaxis.set_major_locator(ticker.FixedLocator((-0.8, -0.4, 0, 0.4, 0.8)))
        for points, color, width in _trajectories(paper_run, rows, in_space_frame):
            axes.plot(time, points[:, 0], points[:, 2], color=color, linewidth=width)
            axes.plot(time[:1], points[:1, 0], points[:1, 2], **hollow(color, 6))
        _legend_over_space(figure, place, _trajectory_legend(paper_run.run.mass_count))

    return draw


def _ball_trajectories(in_space_frame):
    letter = "e" if in_space_frame else "E"

    def draw(figure, place, paper_run):
        axes = space_axes(figure, place, paper_run.radius_m, tuple(f"${letter}_{j}$ [m]" for j in (1, 2, 3)))
        axes.tick_params(labelsize=11)
        draw_sphere(axes, paper_run.radius_m)
        for points, color, width in _trajectories(paper_run, rows_over_time(paper_run.run, 2000), in_space_frame):
            axes.plot(*points.T, color=color, linewidth=width, zorder=3)
            axes.plot(*points[:1].T, zorder=4, **hollow(color, 6))
        _legend_over_space(figure, place, _trajectory_legend(paper_run.run.mass_count))

    return draw


def _magnitude_of_acceleration(figure, place, paper_run):
    axes = figure.add_axes(place)
    time, acceleration = paper_run.acceleration()
    handles = []
    # All masses share one curve. The first is drawn broad and the last thin, so that all are visible.
    for i, name in enumerate(_mass_names(paper_run.run.mass_count)):
        width = 1.4 + 2.4 * (paper_run.run.mass_count - 1 - i)
        handles += axes.plot(time, np.abs(acceleration[:, i]), color=MASS_COLORS[i], linewidth=width, label=name)
    axes.set_xlim(0, 0.5)
    axes.set_ylim(-0.03, 1.1)
    axes.set_xlabel("$t$ [s]")
    axes.set_ylabel(r"$|u_i|$ [rad/s$^2$]")
    legend_above(axes, [handles])


def _name(axes, text, x, y, up_pt):
    axes.annotate(text, (x, y), (13, up_pt), textcoords="offset points", zorder=5,
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8})


def _disk_configuration(figure, place, paper_run):
    axes = figure.add_axes(place)
    axes.add_patch(Circle((0, 0), paper_run.radius_m, fill=False, edgecolor=BLACK, linewidth=2))
    for i, (circle, name) in enumerate(zip(paper_run.rail_circles_B_m(), _mass_names(paper_run.run.mass_count))):
        axes.plot(circle[:, 0], circle[:, 2], color=MASS_COLORS[i], linestyle="--", linewidth=1.2)
        x, _, z = paper_run.masses_B_m()[0, i]
        axes.plot(x, z, color=MASS_COLORS[i], marker="o", markersize=10, zorder=4)
        _name(axes, name, x, z, -5)
    x, _, z = paper_run.shell_center_B_m
    axes.plot(x, z, color=BLACK, marker="s", markersize=8, zorder=4)
    _name(axes, "$m_0$, GC", x, z, 5)
    axes.set_aspect("equal", adjustable="datalim")
    reach = 1.06 * paper_run.radius_m
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), xlabel="$E_1$ [m]", ylabel="$E_3$ [m]")


def _ball_configuration(figure, place, paper_run):
    axes = space_axes(figure, place, paper_run.radius_m, tuple(f"$E_{j}$ [m]" for j in (1, 2, 3)))
    draw_sphere(axes, paper_run.radius_m)
    names = _mass_names(paper_run.run.mass_count)
    for i, (circle, name) in enumerate(zip(paper_run.rail_circles_B_m(), names)):
        axes.plot(*circle.T, color=MASS_COLORS[i], linestyle="--", linewidth=1.2, zorder=2)
        axes.plot(*paper_run.masses_B_m()[:1, i].T, color=MASS_COLORS[i], marker="o", markersize=10, zorder=4)
    axes.plot(*paper_run.shell_center_B_m[:, None], color=BLACK, marker="s", markersize=7, zorder=4)
    axes.plot([0], [0], [0], color=BLACK, marker="+", markersize=12, zorder=4)
    shape = {"linestyle": "", "color": BLACK}
    _legend_over_space(figure, place, [
        [Line2D([], [], color=MASS_COLORS[i], marker="o", linestyle="--", label=f"{name} on its rail")
         for i, name in enumerate(names)],
        [Line2D([], [], marker="s", label="$m_0$", **shape), Line2D([], [], marker="+", label="GC", **shape),
         Line2D([], [], color=LIGHT_GREY, label=f"ball, $r$ = {paper_run.radius_m:g} m")]])


def _disk_rate(figure, place, paper_run):
    axes = _over_time(figure, place, paper_run, r"$\dot\phi$ [rad/s]")
    # phi counts from e1 to E1 with e2 pointing into the page, so it has the opposite sign of Omega_2.
    axes.plot(paper_run.time_s, -np.asarray(paper_run.run.state["angular_velocity_B_radps"][:, 1]), color=BLUE)


def _disk_path(figure, place, paper_run):
    axes = _over_time(figure, place, paper_run, "$z$ [m]")
    axes.plot(paper_run.time_s, paper_run.run.state["position_W_m"][:, 0], color=BLUE)


def _angular_velocity(figure, place, paper_run):
    axes = _over_time(figure, place, paper_run, r"$\Omega_i$ [rad/s]")
    rate = paper_run.run.state["angular_velocity_B_radps"]
    handles = []
    for j, (color, style) in enumerate(((BLUE, "-"), (VERMILLION, "--"), (GREEN, "-."))):
        handles += axes.plot(paper_run.time_s, rate[:, j], color=color, linestyle=style, label=rf"$\Omega_{j + 1}$")
    legend_above(axes, [handles])


def _ball_path(with_friction):
    def draw(figure, place, paper_run):
        axes = figure.add_axes(place)
        z = np.asarray(paper_run.run.state["position_W_m"][:, :2], dtype=float)
        line = axes.plot(z[:, 0], z[:, 1], color=BLUE, label="GC and CP")
        ends = [Line2D([], [], label="start", **hollow(BLACK, 9)),
                Line2D([], [], linestyle="", marker="s", markersize=8, color=BLACK, label="end")]
        extent = np.ptp(z, axis=0).max()
        legend = [line + ends]
        if with_friction:
            rows = rows_along(z, _ARROWS)
            legend.append(friction_arrows(axes, z[rows, 0], z[rows, 1], paper_run.run.friction_force_W()[rows],
                                          0.16 * extent, True))
        mark_ends(axes, z[0], z[-1])
        low, high, margin = z.min(axis=0), z.max(axis=0), (0.14 if with_friction else 0.07) * extent
        axes.set_aspect("equal", adjustable="datalim")
        axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin),
                 xlabel="$z_1$ [m]", ylabel="$z_2$ [m]")
        legend_above(axes, legend)

    return draw


def _normal_force(figure, place, paper_run):
    axes = _over_time(figure, place, paper_run, "$N$ [N]")
    value = np.asarray(paper_run.run.contact["normal_force_n"], dtype=float)
    axes.plot(paper_run.run.contact["time_s"], value, color=BLUE)
    axes.set_ylim(0, 1.06 * value.max())
    least = paper_run.run.extremum("normal_force", "min", "min_time")
    legend_above(axes, [[mark_extremum(axes, "least", least, BLUE)]])


def _detaching_normal_force(figure, place, paper_run):
    axes = _over_time(figure, place, paper_run, "$N$ [N]")
    value = np.asarray(paper_run.run.contact["normal_force_n"], dtype=float)
    axes.plot(paper_run.run.contact["time_s"], value, color=BLUE)
    end_s, published_s = detachment_s(paper_run.run), published_value(paper_run.run, "end.time")
    axes.plot(end_s, 0, zorder=5, clip_on=False, **hollow(BLUE, 7))
    axes.axvline(published_s, color=GREY, linestyle="--", linewidth=1.2)
    axes.set_xlim(0, 1.04 * max(end_s, published_s))
    axes.set_ylim(0, 1.06 * value.max())
    marks = [Line2D([], [], label=f"$N$ = 0 at {time_text(end_s)}", **hollow(BLUE, 7)),
             Line2D([], [], color=GREY, linestyle="--", linewidth=1.2, label=f"the paper: {published_s:g} s")]
    legend_above(axes, [marks])


def _friction_along(figure, place, paper_run):
    axes = _over_time(figure, place, paper_run, r"$\mathbf{e}_1$-component of friction [N]")
    axes.plot(paper_run.run.contact["time_s"], paper_run.run.contact["friction_force_W_n"][:, 0], color=BLUE)


def _friction_magnitude(figure, place, paper_run):
    axes = _over_time(figure, place, paper_run, r"$f_\mathrm{s}$ [N]")
    value = np.asarray(paper_run.run.contact["static_friction_n"], dtype=float)
    axes.plot(paper_run.run.contact["time_s"], value, color=BLUE)
    axes.set_ylim(0, 1.06 * value.max())


def _friction_required(figure, place, paper_run):
    axes = _over_time(figure, place, paper_run, r"$f_\mathrm{s}/N$")
    ratio = paper_run.run.friction_required()
    axes.plot(paper_run.run.contact["time_s"], ratio, color=BLUE)
    found = paper_run.run.extremum("mu_required", "max", "time")
    published = published_value(paper_run.run, "mu_required.max")
    marks = [mark_extremum(axes, "most", found, BLUE),
             axes.axhline(published, color=GREY, linestyle="--", linewidth=1.2, label=f"the paper: {published:g}")]
    axes.set_ylim(0, 1.12 * max(found[0], published))
    legend_above(axes, [marks])


_BODY = ("Trajectories of the {0}'s internal point masses and of the total system center of mass in the body frame, "
         "from the GC")
_SPACE = _BODY.replace("body", "spatial")
FIGURES = (
    PaperFigure("fig_abs_ui", "paper_disk", "Acceleration of the masses", (
        Panel("fig_abs_ui", "Magnitude of the parameterized acceleration, the same for every mass, and 0 from "
              "$t$ = 0.2 s on", _magnitude_of_acceleration),)),
    PaperFigure("fig_disk_masses_rails_bf_gc", "paper_disk", "The rolling disk at t = 0", (
        Panel("fig_disk_masses_rails_bf_gc", "The disk's masses on their rails in the body frame, from the GC",
              _disk_configuration),)),
    PaperFigure("fig_disk_ode_sims", "paper_disk", "Dynamics of the rolling disk", (
        Panel("fig_disk_cm_time_bf_gc", _BODY.format("disk"), _disk_trajectories(False), True),
        Panel("fig_disk_cm_time_spatial_gc", _SPACE.format("disk"), _disk_trajectories(True), True),
        Panel("fig_disk_dot_angle", "Time derivative of the disk's rotation angle", _disk_rate),
        Panel("fig_disk_gc", "Trajectory of the disk's GC and CP", _disk_path))),
    PaperFigure("fig_disk_ode_sims_cp_forces", "paper_disk", "Contact forces on the rolling disk", (
        Panel("fig_disk_normal", "Normal force: always positive", _normal_force),
        Panel("fig_disk_sf", r"$\mathbf{e}_1$-component of the static friction on the disk", _friction_along),
        Panel("fig_disk_coeff_sf", "Static friction over normal force", _friction_required))),
    PaperFigure("fig_ball_masses_rail_bf_gc", "paper_ball", "The rolling ball at t = 0", (
        Panel("fig_ball_masses_rail_bf_gc", "The ball's masses on their rails in the body frame, from the GC",
              _ball_configuration, True),)),
    PaperFigure("fig_ball_dae_sims", "paper_ball", "Dynamics of the rolling ball", (
        Panel("fig_ball_cm_bf_gc", _BODY.format("ball"), _ball_trajectories(False), True),
        Panel("fig_ball_cm_spatial_gc", _SPACE.format("ball"), _ball_trajectories(True), True),
        Panel("fig_ball_Omega", "The ball's body angular velocity", _angular_velocity),
        Panel("fig_ball_gc_path", "Trajectory of the ball's GC and CP", _ball_path(False)))),
    PaperFigure("fig_ball_dae_sims_cp_forces", "paper_ball", "Contact forces on the rolling ball", (
        Panel("fig_ball_normal", "Normal force: always positive", _normal_force),
        Panel("fig_ball_mag_sf", "Magnitude of the static friction", _friction_magnitude),
        Panel("fig_ball_coeff_sf", "Static friction over normal force", _friction_required),
        Panel("fig_ball_sf_sparse", "Static friction atop the trajectory of the GC and CP", _ball_path(True)))),
    PaperFigure("fig_ball_ode_sims_detach", "paper_detach", "The detaching ball", (
        Panel("fig_dball_normal", "Normal force: it vanishes where the ball detaches", _detaching_normal_force),
        Panel("fig_dball_mag_sf", "Magnitude of the static friction", _friction_magnitude),
        Panel("fig_dball_Omega", "The ball's body angular velocity", _angular_velocity),
        Panel("fig_dball_sf_sparse", "Static friction atop the trajectory of the GC and CP", _ball_path(True)))),
)
SCENARIOS = tuple(dict.fromkeys(figure.scenario for figure in FIGURES))


def published_value(run, quantity):
    """The value printed in the paper, which summary.json has from the scenario."""
    for entry in run.summary.get("published", []):
        if entry["quantity"] == quantity:
            return float(entry["published"])
    raise LogError(f"{run.summary_path}: published has no {quantity}")


def detachment_s(run):
    """The time at which N = 0."""
    end = run.summary["end"]
    if end["reason"] != "detached":
        raise LogError(f"{run.summary_path}: end.reason is {end['reason']}; this figure needs a run that detached")
    return float(end["time"])


def draw_figure(paper_figure, paper_run):
    """Draws the panels in the paper's places: two side by side, an odd last one in the middle."""
    count = len(paper_figure.panels)
    single = count == 1
    width = 7.5 if single else 12.0
    row_height, head_height = (6.6 if single else 5.3), 0.75
    rows = 1 if single else math.ceil(count / 2)
    height = head_height + rows * row_height
    figure = Figure(figsize=(width, height))
    figure.text(0.35 / width, 1 - 0.28 / height, paper_figure.title, ha="left", va="top", fontsize=18)
    figure.text(1 - 0.3 / width, 1 - 0.3 / height, f"{paper_figure.label}, {paper_run.run.name}", ha="right", va="top",
                fontsize=12, color=GREY)
    for i, panel in enumerate(paper_figure.panels):
        cell_width = width if single else width / 2
        alone = not single and i == count - 1 and count % 2 == 1
        left = 0.0 if single else (width - cell_width) / 2 if alone else cell_width * (i % 2)
        bottom = height - head_height - row_height * (1 + (0 if single else i // 2))
        caption = panel.caption if single else f"({chr(ord('a') + i)}) {panel.caption}"
        figure.text((left + cell_width / 2) / width, (bottom + 0.62) / height,
                    textwrap.fill(f"{caption}.", _CAPTION_LETTERS), ha="center", va="top", fontsize=13)
        # 3-d axes draw inside their place; the labels of flat axes lie outside it.
        inner = (0.0, 1.05, 0.45, 0.5) if panel.in_space else (0.95, 1.35, 0.35, 0.55)
        place = (left + inner[0], bottom + inner[1], cell_width - inner[0] - inner[2], row_height - inner[1] - inner[3])
        panel.draw(figure, (place[0] / width, place[1] / height, place[2] / width, place[3] / height), paper_run)
    return figure


def _comparison(paper_runs):
    """(label of the panel, quantity, value here, value in the paper) of each comparison."""
    disk, ball, detach = (paper_runs[name].run for name in SCENARIOS)
    for label, run in (("fig_disk_coeff_sf", disk), ("fig_ball_coeff_sf", ball)):
        here = run.extremum("mu_required", "max", "time")
        if here is None:
            raise LogError(f"{run.summary_path}: mu_required.max is missing")
        yield label, "most f_s/N", significant(here[0], 4), f"{published_value(run, 'mu_required.max'):g}"
    yield "fig_dball_normal", "N = 0 at t", significant(detachment_s(detach), 4), f"{published_value(detach, 'end.time'):g}"


def report(paper_runs, out_dir):
    """The text that the program prints: the figures and the numbers that the paper gives too."""
    lines = ["figure (label in the paper)   panels"]
    for figure in FIGURES:
        panels = [panel.label for panel in figure.panels if panel.label != figure.label]
        lines.append(f"  {figure.label:28}{', '.join(panels)}".rstrip())
    lines.append("")
    lines.append(f"  {'panel':20}{'quantity':14}{'here':12}the paper")
    lines += [f"  {label:20}{what:14}{here:12}{paper}" for label, what, here, paper in _comparison(paper_runs)]
    lines.append("")
    lines.append(f"drawn into {out_dir}, one .png per figure, named by its label")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(prog="ballast-paper-figures",
                                     description="Draws the figures of the paper's simulations from finished runs.")
    parser.add_argument("runs_dir", type=Path, help=f"folder with the runs {', '.join(SCENARIOS)}, prescribed")
    parser.add_argument("scenarios_dir", type=Path, help="folder with the scenario files")
    parser.add_argument("out_dir", type=Path, help="folder for the pictures")
    arguments = parser.parse_args()
    try:
        paper_runs = {name: PaperRun(arguments.runs_dir, arguments.scenarios_dir, name) for name in SCENARIOS}
        text = report(paper_runs, arguments.out_dir)
        arguments.out_dir.mkdir(parents=True, exist_ok=True)
        for figure in FIGURES:
            picture = draw_figure(figure, paper_runs[figure.scenario])
            picture.savefig(arguments.out_dir / f"{figure.label}.png", dpi=_WIDTH_PX / picture.get_figwidth())
    except LogError as error:
        print(f"ballast-paper-figures: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"ballast-paper-figures: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
