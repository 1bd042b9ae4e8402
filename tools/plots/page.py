"""Parts that all pictures share: fonts and colours, page, title, legend, events over time, marks and arrows."""

import matplotlib
import numpy as np
from matplotlib import ticker
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import offset_copy

from short_number import short_number, short_time

matplotlib.use("Agg")
matplotlib.rcdefaults()
matplotlib.rcParams.update({
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 14,
    "axes.titlesize": 16,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.fontsize": 12,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "svg.hashsalt": "ballast",
})

# Okabe and Ito's colours, which people with any colour vision can tell apart, without yellow, which is faint on white.
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
BLACK, GREY, LIGHT_GREY = "#000000", "#7F7F7F", "#C8C8C8"
MASS_COLORS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, GREY, "#6B4C1E")
_REGIME_SHADES = {"sliding": "#FAE3D5", "flight": "#CFE8F7"}

# Events closer together than this fraction of the run's duration share one line.
_SAME_INSTANT = 2e-3
# Blocks into which a run is divided to find where a signal rings, and the turns of a signal that rings in a block.
_RINGING_BLOCKS = 300
_RINGING_TURNS = 4
# A curve that extends less than this fraction of its values is drawn as a straight line.
_LEAST_RANGE = 1e-4
# Number of letters of a scenario's name that fit beside the longest title.
_LONGEST_NAME = 28


def mass_name(i):
    """The name of a mass. Masses count from 0, as on the command line and in scenarios."""
    return f"mass {i}"


def time_text(value):
    return rf"$t$ = {short_time(value)} s"


def hollow(color, size):
    return {"linestyle": "", "marker": "o", "markersize": size, "markerfacecolor": "white", "markeredgecolor": color,
            "markeredgewidth": 1.7}


def draw_ringing(axes, time, value, color, width):
    """Draws a signal. Where it swings faster than a picture can show, draws its mean, and a band from least to greatest.

    Returns whether there is such a band.
    """
    if len(value) < 4 * _RINGING_BLOCKS:
        axes.plot(time, value, color=color, linewidth=width)
        return False
    value = np.asarray(value, dtype=float)
    edges = np.linspace(0, len(value), _RINGING_BLOCKS + 1).astype(int)
    starts, ends = edges[:-1], edges[1:] - 1
    finite = np.isfinite(value)
    low, high = np.fmin.reduceat(value, starts), np.fmax.reduceat(value, starts)
    mean = np.add.reduceat(np.where(finite, value, 0), starts) / np.maximum(np.add.reduceat(finite.astype(int), starts), 1)
    slope = np.diff(value, prepend=value[0])
    turns = np.add.reduceat((slope[1:] * slope[:-1] < 0).astype(int), np.minimum(starts, len(value) - 2))
    rings = (turns >= _RINGING_TURNS) & (high - low > 0.02 * np.nanmax(high - low) + 0.01 * np.ptp(value[finite]))
    smooth = np.interp(np.arange(len(value)), (starts + ends) / 2, mean)
    axes.plot(time, np.where(np.repeat(rings, np.diff(edges)) & finite, smooth, value), color=color, linewidth=width)
    if rings.any():
        axes.fill_between(time[np.stack([starts, ends], axis=1).ravel()], np.repeat(low, 2), np.repeat(high, 2),
                          where=np.repeat(rings, 2), color=color, alpha=0.3, linewidth=0)
    return bool(rings.any())


def ringing_legend():
    return Patch(color=GREY, alpha=0.4, label="band: range of fast swings around their mean")


def blank_page(size, rows=1):
    figure = Figure(figsize=size, layout="constrained")
    figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12)
    return figure, figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]


def legend_above(axes, rows):
    """Draws a legend above the axes, one row per list. Returns its height in points."""
    rows = [row for row in rows if row]
    line_pt = 1.4 * matplotlib.rcParams["legend.fontsize"]
    for above, row in enumerate(reversed(rows)):
        place = offset_copy(axes.transAxes, fig=axes.figure, y=4 + above * line_pt, units="points")
        labels = [handle.get_label() for handle in row]
        axes.add_artist(Legend(axes, row, labels, loc="lower left", bbox_to_anchor=(0, 1), bbox_transform=place,
                               ncol=len(row), borderpad=0, borderaxespad=0, handlelength=1.8, columnspacing=1.6,
                               handletextpad=0.6))
    return len(rows) * line_pt


def head(axes, run, title, rows, name_axes=None):
    """Draws the legend, the title and, at the right end, the scenario's name (above `name_axes` if given)."""
    above_legend_pt = 10 + legend_above(axes, rows)
    axes.set_title(title, loc="left", pad=above_legend_pt)
    name = run.name if len(run.name) <= _LONGEST_NAME else run.name[:_LONGEST_NAME - 1] + "\u2026"
    (name_axes or axes).set_title(name.replace("$", r"\$"), loc="right", pad=above_legend_pt, color=GREY, fontsize=12)


def mark_events(all_axes, run):
    """Shades regimes other than rolling; draws impacts and early ends as vertical lines. Returns their legend rows."""
    shades = []
    for regime, color in _REGIME_SHADES.items():
        spans = run.spans(regime)
        for start, end in spans:
            for axes in all_axes:
                axes.axvspan(start, end, color=color, linewidth=0, zorder=0)
        if spans:
            shades.append(Patch(color=color, label=regime))
    impacts = run.impact_times()
    distinct = []
    for time in impacts:
        # Bounces follow each other ever faster before the ball rests. Those at one place are drawn once.
        if not distinct or time - distinct[-1] > _SAME_INSTANT * run.end_s:
            distinct.append(time)
    for axes in all_axes:
        for time in distinct:
            axes.axvline(time, color=BLACK, linewidth=1.0, linestyle=":")
    if impacts:
        label = "impact" if len(impacts) == 1 else f"{len(impacts)} impacts"
        shades.append(Line2D([], [], color=BLACK, linewidth=1.0, linestyle=":", label=label))
    lines = []
    for time, what in run.early_ends():
        if lines and time - lines[-1][0] <= _SAME_INSTANT * run.end_s:
            lines[-1] = (lines[-1][0], f"{lines[-1][1]}; {what}")
        else:
            lines.append((time, what))
    rows = [shades]
    for (time, what), style in zip(lines, ("-.", (0, (1, 1)))):
        for axes in all_axes:
            axes.axvline(time, color=BLACK, linewidth=1.4, linestyle=style)
        rows.append([Line2D([], [], color=BLACK, linewidth=1.4, linestyle=style, label=f"{what}, {time_text(time)}")])
    return rows


def mark_regimes_along(axes, run, z):
    """Marks a curve in the plane: regimes other than rolling as bands under it, impacts as crosses."""
    time = np.asarray(run.state["time_s"], dtype=float)
    row = []
    for regime, color in _REGIME_SHADES.items():
        spans = run.spans(regime)
        for start, end in spans:
            inside = (time >= start) & (time <= end)
            axes.plot(z[inside, 0], z[inside, 1], color=color, linewidth=9, solid_capstyle="butt", zorder=1.5)
        if spans:
            row.append(Patch(color=color, label=regime))
    impacts = run.impact_times()
    if impacts:
        style = {"linestyle": "", "marker": "x", "markersize": 8, "markeredgewidth": 1.8, "color": BLACK}
        axes.plot(*(np.interp(impacts, time, z[:, j]) for j in range(2)), zorder=5, **style)
        label = "impact" if len(impacts) == 1 else f"{len(impacts)} impacts"
        row.append(Line2D([], [], label=label, **style))
    return row


def finish_time_axis(axes, run):
    end = run.end_s
    # A margin on the right keeps a marker or a line at the end of the run visible.
    axes.set_xlim(0, end * 1.01 if end > 0 else 1)
    axes.set_xlabel(r"$t$ [s]")


def mark_extremum(axes, what, found, color, note=""):
    value, time = found
    low, high = axes.get_ylim()
    if np.isfinite(value) and not low <= value <= high:  # an extremum between two ticks may exceed all samples
        margin = 0.06 * (high - low)
        axes.set_ylim(min(low, value - margin), max(high, value + margin))
    axes.plot(time, value, zorder=5, clip_on=False, **hollow(color, 7))
    return Line2D([], [], label=f"{what} {short_number(value)} at {time_text(time)}{note}", **hollow(color, 7))


def limit_height(axes, values, top=None):
    """Sets the vertical limits: from 0, or a little below the lowest value, to a little above `top`.

    `top` defaults to the highest finite value. A stretch of zeros gets a margin below 0, or the axis would hide it.
    """
    finite = values[np.isfinite(values)]
    lowest, highest = finite.min(initial=0), finite.max(initial=0) if top is None else top
    highest = 1.06 * highest if highest > 0 else 1
    stretch = np.count_nonzero(finite == 0) > 1
    axes.set_ylim(1.06 * lowest if lowest < 0 else -0.04 * highest if stretch else 0, highest)


def widen_flat(axes):
    """Gives a curve that hardly changes an axis whose ticks can be told apart."""
    low, high = axes.get_ylim()
    size = max(abs(low), abs(high))
    if high - low < _LEAST_RANGE * size:
        middle = (low + high) / 2
        axes.set_ylim(middle - 0.1 * size, middle + 0.1 * size)


def rows_over_time(run, count):
    """The indices of `count` samples, evenly spread over time."""
    return np.unique(np.linspace(0, len(run.state) - 1, count).round().astype(int))


def rows_along(z, count):
    """The indices of `count` samples, evenly spread along the path, so that arrows do not overlap at low speed."""
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(z, axis=0), axis=1))])
    return np.unique(np.searchsorted(way, np.linspace(0, way[-1], count)))


def mark_ends(axes, first, last):
    axes.plot(*first, zorder=6, **hollow(BLACK, 9))
    axes.plot(*last, marker="s", markersize=8, color=BLACK, zorder=6)


def friction_arrows(axes, x, y, force, arrow_size, equal_axes):
    """Draws forces as arrows; the longest is `arrow_size` long in units of y. Returns the legend entry."""
    longest = float(np.hypot(force[:, 0], force[:, 1]).max(initial=0))
    if longest == 0:
        return []
    visible = np.hypot(force[:, 0], force[:, 1]) > 0.02 * longest  # shorter ones would be dots without a direction
    drawn = force[visible] * (arrow_size / longest)
    scale_units = "xy" if equal_axes else "y"
    axes.quiver(x[visible], y[visible], drawn[:, 0], drawn[:, 1], angles="xy", scale_units=scale_units, scale=1,
                color=VERMILLION, width=0.0035, headwidth=4, headlength=5, headaxislength=4.5, zorder=4)
    label = f"friction force on the ball, longest {short_number(longest)} N"
    return [Line2D([], [], color=VERMILLION, marker=">", markersize=7, label=label)]


def space_axes(figure, place, half_width, names):
    """3-d axes from -half_width to half_width in every direction, viewed from the front right above."""
    axes = figure.add_axes(place, projection="3d", computed_zorder=False)
    axes.set_proj_type("persp", focal_length=1.4)
    axes.view_init(elev=22, azim=-58)
    limits = (-half_width, half_width)
    axes.set(xlim=limits, ylim=limits, zlim=limits)
    axes.set_box_aspect((1, 1, 1))
    for axis, name in zip((axes.xaxis, axes.yaxis, axes.zaxis), names):
        axis.set_label_text(name)
        axis.labelpad = 8
        axis.set_major_locator(ticker.MaxNLocator(5))
        axis.set_pane_color((1, 1, 1, 0))
    return axes


def draw_sphere(axes, radius):
    """Draws the ball as meridians and parallels, behind everything else."""
    turn = np.linspace(0, 2 * np.pi, 121)
    cos, sin = radius * np.cos(turn), radius * np.sin(turn)
    for angle in np.arange(0, np.pi, np.pi / 6):
        c, s = np.cos(angle), np.sin(angle)
        axes.plot(cos * c, cos * s, sin, color=LIGHT_GREY, linewidth=0.6, zorder=1)
        height = np.full_like(turn, radius * c)
        axes.plot(cos * s, sin * s, height, color=LIGHT_GREY, linewidth=0.6, zorder=1)
