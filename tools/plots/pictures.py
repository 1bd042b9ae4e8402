"""The pictures of a run, one function each; the symbols are the paper's. Every function returns a matplotlib figure."""

import math

import matplotlib
import numpy as np
from matplotlib import ticker
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.transforms import offset_copy

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

# Okabe and Ito's colours, which people with any colour vision can tell apart; yellow is left out, it vanishes on white.
BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"
BLACK, GREY, LIGHT_GREY = "#000000", "#7F7F7F", "#C8C8C8"
MASS_COLORS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, GREY, "#6B4C1E")
_REGIME_SHADES = {"sliding": "#F6D8C4", "flight": "#CFE8F7"}

# A path or a drawing is flat in a direction in which it extends less than this part of its size: far above what 20 s of
# integration leave in a coordinate that should stay 0 (1e-10), far below what an eye could see.
_FLAT = 1e-6
# A ratio beyond this has no meaning as a number: N is 0 but for rounding.
_WITHOUT_BOUND = 1e6
# Events closer together than this part of the run share one line in a picture.
_SAME_INSTANT = 2e-3
# Letters of a scenario's name that fit beside the longest title.
_LONGEST_NAME = 28


def _number(value):
    return f"{value:.4g}"


def _time(value):
    return rf"$t$ = {value:.4f} s"


def _hollow(color, size):
    return {"linestyle": "", "marker": "o", "markersize": size, "markerfacecolor": "white", "markeredgecolor": color,
            "markeredgewidth": 1.7}


def _blank_page(size, rows=1):
    figure = Figure(figsize=size, layout="constrained")
    figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12)
    return figure, figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]


def _head(axes, run, title, rows):
    """Title, the scenario's name, and the legend, a row per list: above the axes, where they cover nothing."""
    rows = [row for row in rows if row]
    line_pt = 1.4 * matplotlib.rcParams["legend.fontsize"]
    for above, row in enumerate(reversed(rows)):
        place = offset_copy(axes.transAxes, fig=axes.figure, y=4 + above * line_pt, units="points")
        labels = [handle.get_label() for handle in row]
        axes.add_artist(Legend(axes, row, labels, loc="lower left", bbox_to_anchor=(0, 1), bbox_transform=place,
                               ncol=len(row), borderpad=0, borderaxespad=0, handlelength=1.8, columnspacing=1.6,
                               handletextpad=0.6))
    above_legend_pt = 10 + len(rows) * line_pt
    axes.set_title(title, loc="left", pad=above_legend_pt)
    name = run.name if len(run.name) <= _LONGEST_NAME else run.name[:_LONGEST_NAME - 1] + "\u2026"
    axes.set_title(name.replace("$", r"\$"), loc="right", pad=above_legend_pt, color=GREY, fontsize=12)


def _mark_events(all_axes, run):
    """Regimes other than rolling shaded, impacts and early ends as vertical lines; returns their legend rows."""
    shades = []
    for regime, color in _REGIME_SHADES.items():
        spans = run.spans(regime)
        for start, end in spans:
            for axes in all_axes:
                axes.axvspan(start, end, color=color, linewidth=0, zorder=0)
        if spans:
            shades.append(Patch(color=color, label=regime))
    for axes in all_axes:
        for time in run.impact_times():
            axes.axvline(time, color=GREY, linewidth=1.2, linestyle=":")
    if run.impact_times():
        shades.append(Line2D([], [], color=GREY, linewidth=1.2, linestyle=":", label="impact"))
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
        rows.append([Line2D([], [], color=BLACK, linewidth=1.4, linestyle=style, label=f"{what}, {_time(time)}")])
    return rows


def _finish_time_axis(axes, run):
    end = run.end_s
    # A little air on the right keeps a marker or an event line at the very end whole.
    axes.set_xlim(0, end * 1.01 if end > 0 else 1)
    axes.set_xlabel(r"$t$ [s]")


def _mark_extremum(axes, what, found, color, note=""):
    value, time = found
    axes.plot(time, value, zorder=5, clip_on=False, **_hollow(color, 7))
    return Line2D([], [], label=f"{what} {_number(value)} at {_time(time)}{note}", **_hollow(color, 7))


def _room_above(axes, values):
    """From 0, where the envelope ends, or a little below the lowest value, to a little above the highest finite one."""
    finite = values[np.isfinite(values)]
    highest = finite.max(initial=0)
    axes.set_ylim(1.06 * finite.min(initial=0), 1.06 * highest if highest > 0 else 1)


def _force_picture(run, value, found, found_name, label, title):
    figure, (axes,) = _blank_page((9, 5))
    axes.plot(run.contact["time_s"], value, color=BLUE, linewidth=1.2)
    marks = [_mark_extremum(axes, found_name, found, BLUE)] if found is not None else []
    events = _mark_events([axes], run)
    _room_above(axes, value)
    axes.set_ylabel(label)
    _finish_time_axis(axes, run)
    _head(axes, run, title, [marks, *events])
    return figure


def normal_force(run):
    value = run.contact["normal_force_n"]
    least = run.extremum("normal_force", "min", "min_time")
    if least is not None and abs(least[0]) < 1e-9 * value.max():
        least = 0.0, least[1]  # what detachment leaves of N is rounding
    return _force_picture(run, value, least, "minimum", "$N$ [N]", "Normal force")


def static_friction(run):
    # While it slides, the friction in the log is kinetic.
    title = "Friction" if run.spans("sliding") else "Static friction"
    greatest = run.extremum("static_friction", "max", "time")
    return _force_picture(run, run.contact["static_friction_n"], greatest, "maximum", r"$f_\mathrm{s}$ [N]", title)


def friction_required(run):
    figure, (axes,) = _blank_page((9, 5))
    time, ratio = run.contact["time_s"], run.friction_required()
    axes.plot(time, ratio, color=BLUE, linewidth=1.2)
    largest = run.largest_friction_required()
    limit = run.static_friction_coefficient
    top = 0.0
    marks = []
    if largest is not None:
        # More than rounding above every sample: what the curve does not show needs a word.
        hidden = np.nanmax(ratio) * (1 + 1e-9) < largest[0] <= _WITHOUT_BOUND
        between = " (between ticks)" if hidden else ""
        # Near N = 0 the ratio grows without bound; an axis made for that would flatten everything else to a line at 0.
        usual = 4 * float(np.nanpercentile(ratio, 90))
        top = min(largest[0], usual if math.isinf(limit) else max(usual, 1.5 * limit))
        if largest[0] <= top:
            marks.append(_mark_extremum(axes, "maximum", largest, BLUE, between))
        else:
            size = "without bound" if largest[0] > _WITHOUT_BOUND else f"to {_number(largest[0])}"
            style = {"linestyle": "", "marker": "^", "markersize": 9, "color": BLUE}
            axes.plot(largest[1], 1.06 * top, clip_on=False, zorder=5, **style)
            marks.append(Line2D([], [], label=f"grows {size}, above this axis, at {_time(largest[1])}{between}", **style))
    symbol = r"$\mu_\mathrm{s}$"
    if math.isinf(limit):
        note = Line2D([], [], linestyle="", label=f"perfect friction: {symbol} has no limit")
    elif limit <= 4 * top or top == 0:
        note = axes.axhline(limit, color=VERMILLION, linestyle="--", label=f"limit {symbol} = {_number(limit)}")
        top = max(top, limit)
    else:
        note = Line2D([], [], color=VERMILLION, linestyle="--", label=f"limit {symbol} = {_number(limit)}, far above")
    events = _mark_events([axes], run)
    _room_above(axes, np.array([top]))
    axes.set_ylabel(r"$f_\mathrm{s}/N$")
    _finish_time_axis(axes, run)
    _head(axes, run, "Friction coefficient needed", [marks + [note], *events])
    return figure


def angular_velocity(run):
    figure, (axes,) = _blank_page((9, 5))
    time, rate = run.state["time_s"], run.state["angular_velocity_B_radps"]
    lines = []
    for j, (color, style) in enumerate(((BLUE, "-"), (VERMILLION, "--"), (GREEN, "-."))):
        lines += axes.plot(time, rate[:, j], color=color, linestyle=style, label=rf"$\Omega_{j + 1}$")
    events = _mark_events([axes], run)
    axes.set_ylabel(r"$\Omega_i$ [rad/s]")
    _finish_time_axis(axes, run)
    _head(axes, run, "Angular velocity in the body frame", [lines, *events])
    return figure


def _rows_over_time(run, count):
    """`count` samples, evenly spread over time."""
    return np.unique(np.linspace(0, len(run.state) - 1, count).round().astype(int))


def _rows_along(z, count):
    """`count` samples, evenly spread along the way, so that arrows do not pile up where the ball is slow."""
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(z, axis=0), axis=1))])
    return np.unique(np.searchsorted(way, np.linspace(0, way[-1], count)))


def _end_handles(run):
    ends = [what for _, what in run.early_ends() if not what.startswith("monitor")]
    end = "end" + (f": {ends[-1]}" if ends else "")
    return [
        Line2D([], [], label="start", **_hollow(BLACK, 9)),
        Line2D([], [], linestyle="", marker="s", markersize=8, color=BLACK, label=end),
    ]


def _mark_ends(axes, first, last):
    axes.plot(*first, zorder=6, **_hollow(BLACK, 9))
    axes.plot(*last, marker="s", markersize=8, color=BLACK, zorder=6)


def _friction_arrows(axes, x, y, force, arrow_size, equal_axes):
    """Force vectors from points; the longest is `arrow_size` long in units of y. Returns its legend entry."""
    longest = float(np.hypot(force[:, 0], force[:, 1]).max(initial=0))
    if longest == 0:
        return []
    seen = np.hypot(force[:, 0], force[:, 1]) > 0.02 * longest  # shorter ones would be dots without a direction
    drawn = force[seen] * (arrow_size / longest)
    scale_units = "xy" if equal_axes else "y"
    axes.quiver(x[seen], y[seen], drawn[:, 0], drawn[:, 1], angles="xy", scale_units=scale_units, scale=1,
                color=VERMILLION, width=0.0035, headwidth=4, headlength=5, headaxislength=4.5, zorder=4)
    label = f"friction force on the ball, longest {_number(longest)} N"
    return [Line2D([], [], color=VERMILLION, marker=">", markersize=7, label=label)]


def path(run):
    z = np.asarray(run.state["position_W_m"][:, :2], dtype=float)
    low, high = z.min(axis=0), z.max(axis=0)
    size = float(np.linalg.norm(high - low))
    _, _, directions = np.linalg.svd(z[_rows_over_time(run, 1000)] - z[0], full_matrices=True)
    along = directions[0] if size > 0 else np.array([1.0, 0.0])
    along = along * (1 if along[np.argmax(np.abs(along))] > 0 else -1)
    across = (z - z[0]) @ np.array([-along[1], along[0]])
    return _straight_path(run, z, along) if np.abs(across).max() <= _FLAT * size else _curved_path(run, z, low, high)


def _curved_path(run, z, low, high):
    extent = high - low
    arrow_size = 0.14 * extent.max()
    margin = 0.5 * arrow_size + 0.06 * extent.max()
    width = extent + 2 * margin
    figure, (axes,) = _blank_page((8.5, float(np.clip(8.5 * width[1] / width[0] + 1.0, 5, 9.5))))
    handles = axes.plot(z[:, 0], z[:, 1], color=BLUE, label="GC and CP")
    rows = _rows_along(z, 40)
    arrows = _friction_arrows(axes, z[rows, 0], z[rows, 1], run.friction_force_W()[rows], arrow_size, True)
    _mark_ends(axes, z[0], z[-1])
    # The page keeps its shape: where the path is slim the axes reach further, so title and legend have their room.
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_xlabel("$z_1$ [m]")
    axes.set_ylabel("$z_2$ [m]")
    _head(axes, run, "Path of the GC, with friction", [handles + _end_handles(run), arrows])
    return figure


def _straight_path(run, z, along):
    """Against time, as the paper shows its disk; the friction force, too, is drawn along the line."""
    axis = int(np.argmax(np.abs(along)))
    on_axis = abs(along[1 - axis]) <= _FLAT
    distance = z[:, axis] if on_axis else (z - z[0]) @ along
    force = run.friction_force_W() @ along
    figure, (axes,) = _blank_page((9, 5.5))
    time = np.asarray(run.state["time_s"], dtype=float)
    handles = axes.plot(time, distance, color=BLUE, label="GC and CP")
    extent = float(np.ptp(distance)) or 1.0
    arrow_size = 0.14 * extent
    rows = _rows_over_time(run, 60)
    # Matplotlib finds an arrow's direction with a step it takes from the extent of the data, which a run of one sample
    # has not.
    axes.update_datalim([(run.end_s, distance.max() + arrow_size)])
    upright = np.stack([np.zeros(len(rows)), force[rows]], axis=1)
    arrows = _friction_arrows(axes, time[rows], distance[rows], upright, arrow_size, False)
    _mark_ends(axes, (time[0], distance[0]), (time[-1], distance[-1]))
    events = _mark_events([axes], run)
    axes.set_ylim(distance.min() - 0.05 * extent - arrow_size, distance.max() + 0.05 * extent + arrow_size)
    _finish_time_axis(axes, run)
    axes.set_xlim(left=-0.015 * run.end_s if run.end_s > 0 else None)
    axes.set_ylabel(f"$z_{axis + 1}$ [m]" if on_axis else f"distance along ({along[0]:.3g}, {along[1]:.3g}) [m]")
    _head(axes, run, "Straight path of the GC, with friction", [handles + _end_handles(run), arrows, *events])
    return figure


def body_frame(run):
    rows = _rows_over_time(run, 3000)
    masses = np.asarray(run.state["mass_position_B_m"][rows, :run.mass_count], dtype=float)
    center = np.asarray(run.state["center_of_mass_B_m"][rows], dtype=float)
    radius = run.ball_radius_m()
    everything = np.concatenate([masses.reshape(-1, 3), center])
    reach = float(np.linalg.norm(everything, axis=1).max())
    half_width = max(radius or 0.0, reach) or 1.0
    # The centre of mass comes last and thin: where a heavy mass takes it along, both stay visible.
    curves = [(masses[:, i], MASS_COLORS[i], 2.4, f"$m_{i + 1}$") for i in range(run.mass_count)]
    curves.append((center, BLACK, 1.2, "centre of mass of the system"))
    # E_1-E_3 comes first: it is the plane of the paper's disk.
    for normal, plane in ((1, (0, 2)), (2, (0, 1)), (0, (1, 2))):
        if np.abs(everything[:, normal]).max() <= _FLAT * half_width and run.mass_count > 0:
            return _body_plane(run, curves, plane, radius, half_width)
    return _body_space(run, curves, radius, half_width)


def _body_legend(curves, radius):
    lines = [Line2D([], [], color=color, linewidth=width, label=label) for _, color, width, label in curves]
    start = Line2D([], [], label="start", **_hollow(BLACK, 7))
    ball = [Line2D([], [], color=LIGHT_GREY, linewidth=2, label=f"ball, $r$ = {_number(radius)} m")] if radius else []
    return [lines[:-1], [lines[-1], start, *ball]]


def _body_plane(run, curves, plane, radius, half_width):
    figure, (axes,) = _blank_page((7.5, 8))
    if radius:
        axes.add_patch(Circle((0, 0), radius, fill=False, edgecolor=LIGHT_GREY, linewidth=2))
    axes.plot(0, 0, marker="+", markersize=10, color=GREY)
    for points, color, width, _ in curves:
        xy = points[:, plane]
        axes.plot(xy[:, 0], xy[:, 1], color=color, linewidth=width)
        axes.plot(*xy[0], zorder=5, **_hollow(color, 7))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(-1.05 * half_width, 1.05 * half_width)
    axes.set_ylim(-1.05 * half_width, 1.05 * half_width)
    axes.set_xlabel(f"$E_{plane[0] + 1}$ [m]")
    axes.set_ylabel(f"$E_{plane[1] + 1}$ [m]")
    _head(axes, run, "Masses in the body frame, from the GC", _body_legend(curves, radius))
    return figure


def _body_space(run, curves, radius, half_width):
    figure = Figure(figsize=(8.5, 8.5))
    axes = figure.add_axes((0.0, 0.01, 0.97, 0.93), projection="3d", computed_zorder=False)
    axes.set_proj_type("persp", focal_length=1.4)
    axes.view_init(elev=22, azim=-58)
    if radius:
        turn = np.linspace(0, 2 * np.pi, 121)
        cos, sin = radius * np.cos(turn), radius * np.sin(turn)
        for angle in np.arange(0, np.pi, np.pi / 6):
            c, s = np.cos(angle), np.sin(angle)
            axes.plot(cos * c, cos * s, sin, color=LIGHT_GREY, linewidth=0.6, zorder=1)
            height = np.full_like(turn, radius * c)
            axes.plot(cos * s, sin * s, height, color=LIGHT_GREY, linewidth=0.6, zorder=1)
    for points, color, width, _ in curves:
        axes.plot(*points.T, color=color, linewidth=width, zorder=3)
        axes.plot(*points[:1].T, zorder=4, **_hollow(color, 8))
    limits = (-half_width, half_width)
    axes.set(xlim=limits, ylim=limits, zlim=limits)
    axes.set_box_aspect((1, 1, 1))
    for axis, name in ((axes.xaxis, "$E_1$ [m]"), (axes.yaxis, "$E_2$ [m]"), (axes.zaxis, "$E_3$ [m]")):
        axis.set_label_text(name)
        axis.labelpad = 8
        axis.set_major_locator(ticker.MaxNLocator(5))
        axis.set_pane_color((1, 1, 1, 0))
    # A flat frame over the whole page carries title and legend as in every other picture.
    frame = figure.add_axes((0.03, 0.0, 0.94, 0.89), zorder=1)
    frame.axis("off")
    _head(frame, run, "Masses in the body frame, from the GC", _body_legend(curves, radius))
    return figure


def masses(run):
    """Where the controller asked the masses to be and where they were; None for a run without a controller."""
    pair = run.commanded_and_true()
    if pair is None:
        return None
    time, commanded, true = pair
    figure, (upper, lower) = _blank_page((9, 8), rows=2)
    handles = []
    for i in range(run.mass_count):
        handles += upper.plot(time, true[:, i], color=MASS_COLORS[i], label=rf"$\theta_{i + 1}$")
        upper.plot(time, commanded[:, i], color=BLACK, linestyle=(0, (4, 4)), linewidth=0.9)
        lower.plot(time, true[:, i] - commanded[:, i], color=MASS_COLORS[i], linewidth=1.0)
    command = [Line2D([], [], color=BLACK, linestyle=(0, (4, 4)), linewidth=0.9, label="commanded")]
    events = _mark_events([upper, lower], run)
    upper.set_ylabel(r"$\theta_i$ [rad, or m on a line]")
    lower.set_ylabel(r"$\theta_i$, true $-$ commanded")
    lower.axhline(0, color=BLACK, linewidth=0.6)
    lower.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    _finish_time_axis(upper, run)
    _finish_time_axis(lower, run)
    upper.set_xlabel("")
    legend = [handles + command] if run.mass_count <= 6 else [handles, command]
    _head(upper, run, "Masses: true and commanded positions", legend + events)
    return figure


# File name (without ending) and the function that draws it.
PICTURES = {
    "normal_force": normal_force,
    "static_friction": static_friction,
    "friction_required": friction_required,
    "path": path,
    "angular_velocity": angular_velocity,
    "body_frame": body_frame,
    "masses": masses,
}
