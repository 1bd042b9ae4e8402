"""The pictures of a run. Each function draws one and returns a matplotlib figure, or None where the picture does not
apply. Symbols are the paper's."""

import math

import numpy as np
from matplotlib import ticker
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from floor_patches import draw_floor_friction, draw_patches, shade_patches_along
from page import (BLACK, BLUE, GREEN, GREY, LIGHT_GREY, MASS_COLORS, ORANGE, PURPLE,
                  VERMILLION, blank_page, draw_ringing,
                  draw_sphere, finish_time_axis, friction_arrows, head, hollow, legend_above, mark_ends, mark_events, mark_extremum,
                  limit_height, mark_regimes_along, mass_name, ringing_legend, rows_along, rows_over_time, space_axes,
                  time_text)
from known import governed_spans
from known_pictures import belief, estimate
from plan_pictures import plan_need, plan_path
from short_number import short_number

# A path is flat in a direction in which it extends less than this fraction of its size. 20 s of integration leave 1e-10
# in a coordinate that should stay 0; an eye sees nothing below 1e-3.
_FLAT = 1e-6
# f_s / N beyond this is not a meaningful number: N is 0 except for rounding.
_WITHOUT_BOUND = 1e6
# The available torque is drawn if it is at most this many times the greatest torque. Further away it would flatten the
# torque's curve.
_LIMIT_IN_SIGHT = 2.5
# Percent. Margins below this are cut off: the motor is too weak, by however much.
_LEAST_MARGIN_SHOWN = -110


def _force_picture(run, value, found, found_name, label, title):
    figure, (axes,) = blank_page((9, 5))
    axes.plot(run.contact["time_s"], value, color=BLUE, linewidth=1.2)
    marks = [mark_extremum(axes, found_name, found, BLUE)] if found is not None else []
    events = mark_events([axes], run)
    limit_height(axes, value)
    axes.set_ylabel(label)
    finish_time_axis(axes, run)
    head(axes, run, title, [marks, *events])
    return figure


def normal_force(run):
    value = run.contact["normal_force_n"]
    least = run.extremum("normal_force", "min", "min_time")
    if least is not None and abs(least[0]) < 1e-9 * value.max():
        least = 0.0, least[1]  # at detachment N is 0 except for rounding
    return _force_picture(run, value, least, "minimum", "$N$ [N]", "Normal force")


def static_friction(run):
    # While the ball slides, the friction in the log is kinetic.
    title = "Friction" if run.spans("sliding") else "Static friction"
    greatest = run.extremum("static_friction", "max", "time")
    return _force_picture(run, run.contact["static_friction_n"], greatest, "maximum", r"$f_\mathrm{s}$ [N]", title)


def _mark_governor(axes, run):
    """Strips along the lower edge where the governor bent the commands. Returns the legend entries."""
    handles = []
    governor = run.summary.get("governor") or {}
    of_both = zip(governed_spans(run), ("bent", "backup"), ("bent by the governor", "on the backup"), (ORANGE, PURPLE),
                  (0.02, 0.012))
    for spans, share, name, color, height in of_both:
        for start_s, end_s in spans:
            axes.axvspan(start_s, end_s, ymax=height, color=color, linewidth=0, zorder=4)
        if spans:
            label = f"{name} {100 * governor[share]:.0f} %" if share in governor else name
            handles.append(Patch(color=color, label=label))
    return handles


def friction_required(run):
    figure, (axes,) = blank_page((9, 5))
    time, ratio = run.contact["time_s"], run.friction_required()
    axes.plot(time, ratio, color=BLUE, linewidth=1.2)
    largest = run.largest_friction_required()
    limit = run.static_friction_coefficient
    top = 0.0
    marks = []
    if largest is not None:
        # A maximum above every sample, by more than rounding, lies between two ticks. The curve does not show it.
        hidden = np.nanmax(ratio) * (1 + 1e-9) < largest[0] <= _WITHOUT_BOUND
        between = " (between ticks)" if hidden else ""
        # Near N = 0 the ratio grows without bound, and an axis up to there would flatten everything else.
        usual = 4 * float(np.nanpercentile(ratio, 90))
        top = min(largest[0], usual if math.isinf(limit) else max(usual, 1.5 * limit))
        if largest[0] <= top:
            marks.append(mark_extremum(axes, "maximum", largest, BLUE, between))
        else:
            style = {"linestyle": "", "marker": "^", "markersize": 9, "color": BLUE}
            axes.plot(largest[1], 1.06 * top, clip_on=False, zorder=5, **style)
            what = "no bound, $N$ = 0" if largest[0] > _WITHOUT_BOUND else f"grows to {short_number(largest[0])}"
            marks.append(Line2D([], [], label=f"{what}, above this axis, at {time_text(largest[1])}{between}", **style))
    symbol = r"$\mu_\mathrm{s}$"
    if (under := run.static_friction_under_ball()) is not None:
        note = draw_floor_friction(axes, run, under)
        top = max(top, min(float(under[np.isfinite(under)].max(initial=0)), 4 * top))
    elif math.isinf(limit):
        note = Line2D([], [], linestyle="", label=f"perfect friction: {symbol} has no limit")
    elif limit <= 4 * top or top == 0:
        note = axes.axhline(limit, color=VERMILLION, linestyle="--", label=f"limit {symbol} = {short_number(limit)}")
        top = max(top, limit)
    else:
        note = Line2D([], [], color=VERMILLION, linestyle="--",
                      label=f"limit {symbol} = {short_number(limit)}, far above")
    events = mark_events([axes], run)
    limit_height(axes, ratio, top)
    governor = _mark_governor(axes, run)
    axes.set_ylabel(r"$f_\mathrm{s}/N$")
    finish_time_axis(axes, run)
    # While the ball slides, f_s / N is the kinetic coefficient.
    title = "Friction coefficient needed to roll; kinetic where it slides"
    head(axes, run, title if run.spans("sliding") else "Friction coefficient needed",
         [marks + [note], *([governor] if governor else []), *events])
    return figure


def angular_velocity(run):
    figure, (axes,) = blank_page((9, 5))
    time, rate = run.state["time_s"], run.state["angular_velocity_B_radps"]
    lines = []
    for j, (color, style) in enumerate(((BLUE, "-"), (VERMILLION, "--"), (GREEN, "-."))):
        lines += axes.plot(time, rate[:, j], color=color, linestyle=style, label=rf"$\Omega_{j + 1}$")
    events = mark_events([axes], run)
    axes.set_ylabel(r"$\Omega_i$ [rad/s]")
    finish_time_axis(axes, run)
    head(axes, run, "Angular velocity in the body frame", [lines, *events])
    return figure


def _path_label(run):
    """The label of the path. Centre and contact point have the same path on the floor; in flight there is no contact."""
    return "ball's centre" if run.leaves_the_ground() else "ball's centre and contact point"


def _end_handles(run):
    ends = [what for _, what in run.early_ends() if not what.startswith("monitor")]
    end = "end" + (f": {ends[-1]}" if ends else "")
    return [
        Line2D([], [], label="start", **hollow(BLACK, 9)),
        Line2D([], [], linestyle="", marker="s", markersize=8, color=BLACK, label=end),
    ]


def path(run):
    z = np.asarray(run.state["position_W_m"][:, :2], dtype=float)
    low, high = z.min(axis=0), z.max(axis=0)
    size = float(np.linalg.norm(high - low))
    _, _, directions = np.linalg.svd(z[rows_over_time(run, 1000)] - z[0], full_matrices=True)
    along = directions[0] if size > 0 else np.array([1.0, 0.0])
    along = along * (1 if along[np.argmax(np.abs(along))] > 0 else -1)
    across = (z - z[0]) @ np.array([-along[1], along[0]])
    return _straight_path(run, z, along) if np.abs(across).max() <= _FLAT * size else _curved_path(run, z, low, high)


def _curved_path(run, z, low, high):
    extent = high - low
    arrow_size = 0.14 * extent.max()
    margin = 0.5 * arrow_size + 0.06 * extent.max()
    width = extent + 2 * margin
    figure, (axes,) = blank_page((8.5, float(np.clip(8.5 * width[1] / width[0] + 1.0, 5, 9.5))))
    handles = axes.plot(z[:, 0], z[:, 1], color=BLUE, label=_path_label(run))
    rows = rows_along(z, 24)
    arrows = friction_arrows(axes, z[rows, 0], z[rows, 1], run.friction_force_W()[rows], arrow_size, True)
    regimes = mark_regimes_along(axes, run, z)
    mark_ends(axes, z[0], z[-1])
    # The page keeps its shape. For a slim path the axes reach further, so that title and legend fit.
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    patches = draw_patches(axes, run.patches)
    axes.set_xlabel("$z_1$ [m]")
    axes.set_ylabel("$z_2$ [m]")
    head(axes, run, "Path of the ball, with friction", [handles + _end_handles(run), arrows, regimes] + ([patches] if patches else []))
    return figure


def _straight_path(run, z, along):
    """Draws the distance over time, as the paper does for its disk, with the friction force along the line."""
    axis = int(np.argmax(np.abs(along)))
    on_axis = abs(along[1 - axis]) <= _FLAT
    distance = z[:, axis] if on_axis else (z - z[0]) @ along
    force = run.friction_force_W() @ along
    figure, (axes,) = blank_page((9, 5.5))
    time = np.asarray(run.state["time_s"], dtype=float)
    handles = axes.plot(time, distance, color=BLUE, label=_path_label(run))
    extent = float(np.ptp(distance)) or 1.0
    arrow_size = 0.14 * extent
    rows = rows_over_time(run, 60)
    # Matplotlib needs data of nonzero extent to find an arrow's direction; a run of one sample has none.
    axes.update_datalim([(run.end_s, distance.max() + arrow_size)])
    upright = np.stack([np.zeros(len(rows)), force[rows]], axis=1)
    arrows = friction_arrows(axes, time[rows], distance[rows], upright, arrow_size, False)
    mark_ends(axes, (time[0], distance[0]), (time[-1], distance[-1]))
    events = mark_events([axes], run)
    patches = shade_patches_along(axes, run.patches, z, distance)
    axes.set_ylim(distance.min() - 0.05 * extent - arrow_size, distance.max() + 0.05 * extent + arrow_size)
    finish_time_axis(axes, run)
    axes.set_xlim(left=-0.015 * run.end_s if run.end_s > 0 else None)
    axes.set_ylabel(f"$z_{axis + 1}$ [m]" if on_axis else f"distance along ({short_number(along[0])}, {short_number(along[1])}) [m]")
    title = "Straight path of the ball, with friction" if np.ptp(distance) > 0 else "Path of the ball: it stays in place"
    head(axes, run, title, [handles + _end_handles(run), arrows, *events] + ([patches] if patches else []))
    return figure


def body_frame(run):
    """Draws the paths of the masses in the body frame; None for a ball without masses."""
    if run.mass_count == 0:
        return None
    rows = rows_over_time(run, 3000)
    masses = np.asarray(run.state["mass_position_B_m"][rows, :run.mass_count], dtype=float)
    center = np.asarray(run.state["center_of_mass_B_m"][rows], dtype=float)
    radius = run.ball_radius_m()
    everything = np.concatenate([masses.reshape(-1, 3), center])
    reach = float(np.linalg.norm(everything, axis=1).max())
    half_width = max(radius or 0.0, reach) or 1.0
    # The centre of mass comes last and thin, so that it does not cover the path of a heavy mass.
    curves = [(masses[:, i], MASS_COLORS[i], 2.4, mass_name(i)) for i in range(run.mass_count)]
    curves.append((center, BLACK, 1.2, "centre of mass of the system"))
    # E_1-E_3, the plane of the paper's disk, comes first.
    for normal, plane in ((1, (0, 2)), (2, (0, 1)), (0, (1, 2))):
        if np.abs(everything[:, normal]).max() <= _FLAT * half_width:
            return _body_plane(run, curves, plane, radius, half_width)
    return _body_space(run, curves, radius, half_width)


def _body_legend(curves, radius):
    lines = [Line2D([], [], color=color, linewidth=width, label=label) for _, color, width, label in curves]
    start = Line2D([], [], label="start", **hollow(BLACK, 7))
    second = [lines[-1], start]
    if radius:
        second.append(Line2D([], [], color=LIGHT_GREY, linewidth=2, label=f"ball, $r$ = {short_number(radius)} m"))
    return [lines[:-1], second]


def _body_plane(run, curves, plane, radius, half_width):
    figure, (axes,) = blank_page((7.5, 8))
    if radius:
        axes.add_patch(Circle((0, 0), radius, fill=False, edgecolor=LIGHT_GREY, linewidth=2))
    axes.plot(0, 0, marker="+", markersize=10, color=GREY)
    for points, color, width, _ in curves:
        xy = points[:, plane]
        axes.plot(xy[:, 0], xy[:, 1], color=color, linewidth=width)
        axes.plot(*xy[0], zorder=5, clip_on=False, **hollow(color, 7))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(-1.08 * half_width, 1.08 * half_width)
    axes.set_ylim(-1.08 * half_width, 1.08 * half_width)
    axes.set_xlabel(f"$E_{plane[0] + 1}$ [m]")
    axes.set_ylabel(f"$E_{plane[1] + 1}$ [m]")
    head(axes, run, "Masses in the body frame, from the centre", _body_legend(curves, radius))
    return figure


def _body_space(run, curves, radius, half_width):
    figure = Figure(figsize=(8.5, 8.5))
    axes = space_axes(figure, (0.0, 0.01, 0.97, 0.93), half_width, ("$E_1$ [m]", "$E_2$ [m]", "$E_3$ [m]"))
    if radius:
        draw_sphere(axes, radius)
    for points, color, width, _ in curves:
        axes.plot(*points.T, color=color, linewidth=width, zorder=3)
        axes.plot(*points[:1].T, zorder=4, **hollow(color, 8))
    # A flat frame over the whole page carries title and legend.
    frame = figure.add_axes((0.03, 0.0, 0.94, 0.89), zorder=1)
    frame.axis("off")
    head(frame, run, "Masses in the body frame, from the centre", _body_legend(curves, radius))
    return figure


def masses(run):
    """Draws commanded and true positions of the masses; None for a run without a controller."""
    pair = run.commanded_and_true()
    if pair is None:
        return None
    time, commanded, true = pair
    figure, (upper, lower) = blank_page((9, 8), rows=2)
    handles = []
    for i in range(run.mass_count):
        handles += upper.plot(time, true[:, i], color=MASS_COLORS[i], label=mass_name(i))
        upper.plot(time, commanded[:, i], color=BLACK, linestyle=(0, (4, 4)), linewidth=0.9)
        lower.plot(time, true[:, i] - commanded[:, i], color=MASS_COLORS[i], linewidth=1.0)
    command = [Line2D([], [], color=BLACK, linestyle=(0, (4, 4)), linewidth=0.9, label="commanded")]
    events = mark_events([upper, lower], run)
    upper.set_ylabel(r"$\theta$ [rad, or m]")
    lower.set_ylabel(r"$\theta$, true $-$ commanded")
    lower.axhline(0, color=BLACK, linewidth=0.6)
    lower.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    finish_time_axis(upper, run)
    finish_time_axis(lower, run)
    upper.set_xlabel("")
    legend = [handles + command] if run.mass_count <= 6 else [handles, command]
    head(upper, run, "Masses: true and commanded positions", legend + events)
    return figure


def motor_share(run):
    """Draws N, f_s and f_s / N of the real and the commanded motion, and the difference; None if nothing commands."""
    found = run.commanded_contact()
    if found is None:
        return None
    time, pairs = found
    figure = Figure(figsize=(11, 9), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12, hspace=0.04)
    rows = figure.subplots(3, 2, sharex=True)
    events = mark_events(list(rows.flat), run)
    # Samples where the ball does not roll are left out, and no line is drawn across the gap.
    ringing = False
    breaks = np.flatnonzero(np.diff(time) > 1.5 * run.summary["control_period"]) + 1
    for (name, (real, commanded)), (left, right), symbol, unit in zip(
            pairs.items(), rows, ("$N$", r"$f_\mathrm{s}$", r"$f_\mathrm{s}/N$"), (" [N]", " [N]", "")):
        at, real, commanded = (np.insert(values, breaks, np.nan) for values in (time, real, commanded))
        ringing = draw_ringing(left, at, real, VERMILLION, 0.9) or ringing
        left.plot(at, commanded, color=BLUE, linewidth=1.4)
        difference = real - commanded
        ringing = draw_ringing(right, at, difference, BLACK, 0.8) or ringing
        right.axhline(0, color=GREY, linewidth=0.6)
        left.set_ylabel(symbol + unit)
        right.set_ylabel(rf"$\Delta$ {symbol}{unit}")
        both = np.concatenate([real, commanded])
        usual = 4 * float(np.nanpercentile(both, 90))
        if np.nanmax(both) > 5 * usual > 0:  # near N = 0 the ratio grows without bound and would flatten the rest
            left.set_ylim(0, usual)
            right.set_ylim(-usual, usual)
        # The summary's deviation is the motors' share, without that of belief and estimate.
        greatest = None if run.commands_as_believed else run.greatest_deviation(name.removesuffix("_n"))
        if greatest is not None:
            low, high = right.get_ylim()
            off = "" if low <= greatest[0] <= high else ", off this axis"
            if not off:
                right.plot(greatest[1], greatest[0], zorder=5, clip_on=False, **hollow(VERMILLION, 7))
            label = f"furthest apart {short_number(greatest[0])} at {time_text(greatest[1])}{off}"
            legend_above(right, [[Line2D([], [], label=label, **hollow(VERMILLION, 7))]])
    for axes in rows.flat:
        finish_time_axis(axes, run)
        axes.xaxis.set_major_locator(ticker.MaxNLocator(6))
        if axes not in rows[-1]:
            axes.set_xlabel("")
    as_believed = run.commands_as_believed
    curves = [Line2D([], [], color=VERMILLION, label="real"),
              Line2D([], [], color=BLUE, label="commanded, as believed" if as_believed else "commanded")]
    title = "Real less commanded, as the robot believes" if as_believed else "The motors' share: real less commanded"
    head(rows[0, 0], run, title, [curves, [ringing_legend()] if ringing else [], *events], name_axes=rows[0, 1])
    return figure


def height(run):
    """Draws the height above contact; None for a ball that stays on the ground."""
    if not run.leaves_the_ground():
        return None
    figure, (axes,) = blank_page((9, 5))
    time = run.state["time_s"]
    value = np.asarray(run.state["position_W_m"][:, 2], dtype=float)
    axes.plot(time, value, color=BLUE, linewidth=1.4)
    top = int(np.argmax(value))
    marks = [mark_extremum(axes, "highest", (float(value[top]), float(time[top])), BLUE)]
    events = mark_events([axes], run)
    axes.set_ylabel("height above contact [m]")
    limit_height(axes, value)
    finish_time_axis(axes, run)
    head(axes, run, "Height of the ball above contact", [marks, *events])
    return figure


def motors(run):
    """Draws the torque and the torque margin of each motor; None for a ball without motors."""
    found = run.motors()
    if not found:
        return None
    figure = Figure(figsize=(10, 2.6 + 2.1 * len(found)), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12, hspace=0.04)
    rows = figure.subplots(len(found), 2, sharex=True, squeeze=False)
    time = run.state["time_s"]
    events = mark_events(list(rows.flat), run)
    top_legend, ringing = None, False
    for i, (motor, (left, right)) in enumerate(zip(found, rows)):
        color = MASS_COLORS[motor.mass]
        ringing = draw_ringing(left, time, motor.torque_nm, color, 1.0) or ringing
        ringing = draw_ringing(right, time, 100 * motor.margin, color, 1.0) or ringing
        least, most = short_number(motor.available_nm.min()), short_number(motor.available_nm.max())
        available = least if least == most else f"{least} to {most}"
        label = f"{mass_name(motor.mass)}: at most {short_number(motor.greatest_nm)} of {available} N m"
        torque_legend = [Line2D([], [], color=color, label=label)]
        if motor.available_nm.min() <= _LIMIT_IN_SIGHT * motor.greatest_nm:
            for sign in (1, -1):
                left.plot(time, sign * motor.available_nm, color=BLACK, linestyle="--", linewidth=1.1)
            torque_legend.append(Line2D([], [], color=BLACK, linestyle="--", linewidth=1.1, label="available"))
        lowest = 100 * min(motor.margin.min(), motor.least_margin)
        cut = ", off this axis" if lowest < _LEAST_MARGIN_SHOWN else ""
        margin_legend = [Line2D([], [], color=color, label=f"least margin {short_number(100 * motor.least_margin)} %{cut}")]
        right.axhline(0, color=BLACK, linewidth=0.8)
        right.set_ylim(max(min(1.06 * lowest, -4), _LEAST_MARGIN_SHOWN), 104)
        left.set_ylabel(r"$\tau$ [N m]")
        right.set_ylabel("margin [%]")
        legend_above(right, [margin_legend])
        if i == 0:
            top_legend = torque_legend
        else:
            legend_above(left, [torque_legend])
    for axes in rows.flat:
        finish_time_axis(axes, run)
        axes.xaxis.set_major_locator(ticker.MaxNLocator(6))
        if axes not in rows[-1]:
            axes.set_xlabel("")
    title = "Torque at the motors' shafts" if run.is_stepper else "Torque needed at the motors' shafts"
    head(rows[0, 0], run, f"{title}, and margin", [*events, [ringing_legend()] if ringing else [], top_legend], name_axes=rows[0, 1])
    return figure


# File name (without ending) and the function that draws it.
PICTURES = {
    "normal_force": normal_force,
    "static_friction": static_friction,
    "friction_required": friction_required,
    "path": path,
    "angular_velocity": angular_velocity,
    "body_frame": body_frame,
    "height": height,
    "masses": masses,
    "motors": motors,
    "motor_share": motor_share,
    "plan_path": plan_path,
    "plan_need": plan_need,
    "estimate": estimate,
    "belief": belief,
}
