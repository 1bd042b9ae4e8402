"""The pictures of a plan and of the run that drove it. Each function returns None for a run without a plan."""

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon

from floor_patches import draw_floor_friction, draw_patches
from page import (BLACK, BLUE, GREEN, GREY, LIGHT_GREY, ORANGE, PURPLE, VERMILLION, blank_page, draw_ringing,
                  finish_time_axis, head, hollow, mark_ends, mark_events, ringing_legend)
from short_number import short_number

_OBSTACLE, _CLEARANCE, _BAND = "#B0B0B0", "#EFE3DC", "#E3F1EC"
# Below this a need is drawn as this: the logarithmic axis has to end somewhere.
_LEAST_NEED = 1e-4
# The axis is logarithmic where the run needs this many times what the plan does.
_FAR_APART = 5


def _length_text(metres):
    """In mm or m, two digits."""
    return f"{1e3 * metres:.2g} mm" if metres < 0.01 else f"{metres:.2g} m"


def _draw_band(axes, points, tolerance):
    """All places within `tolerance` of the polyline."""
    style = {"color": _BAND, "linewidth": 0, "zorder": 0.5}
    for point in points:
        axes.add_patch(Circle(point, tolerance, **style))
    for first, last in zip(points[:-1], points[1:]):
        along = last - first
        length = np.linalg.norm(along)
        if length == 0:
            continue
        aside = tolerance * np.array([-along[1], along[0]]) / length
        axes.add_patch(Polygon([first + aside, last + aside, last - aside, first - aside], **style))
    line, = axes.plot(points[:, 0], points[:, 1], color=GREEN, linewidth=1.0, linestyle=(0, (1, 2)), zorder=0.8)
    line.set_label("path to follow")
    return [line, Patch(color=_BAND, label=f"within {_length_text(tolerance)} of it")]


def _draw_obstacles(axes, planned):
    for center, radius in planned.keep_out:
        axes.add_patch(Circle(center, radius + planned.radius, facecolor=_CLEARANCE, edgecolor=VERMILLION, linewidth=0.8,
                              linestyle=(0, (4, 3)), zorder=0.6))
    for center, radius in planned.keep_out:
        axes.add_patch(Circle(center, radius, facecolor=_OBSTACLE, edgecolor=GREY, linewidth=0.8, hatch="///", zorder=0.7))
    if not planned.keep_out:
        return []
    return [Patch(facecolor=_OBSTACLE, edgecolor=GREY, hatch="///", label="keep out"),
            Patch(facecolor=_CLEARANCE, edgecolor=VERMILLION, linestyle="--",
                  label="where the ball would reach into it")]


def _draw_goals(axes, planned):
    """Goal and via places. Returns their legend entries."""
    axes.plot(*planned.goal, linestyle="", marker="x", markersize=13, markeredgewidth=2.6, color=VERMILLION, zorder=6.5)
    label = "goal, at rest" if planned.at_rest else "goal"
    handles = [Line2D([], [], linestyle="", marker="x", markersize=11, markeredgewidth=2.4, color=VERMILLION, label=label)]
    for number, (place, time) in enumerate(planned.via):
        axes.plot(*place, zorder=6.4, linestyle="", marker="D", markersize=8, color=PURPLE)
        note = f" {number}" if time is None else f" {number}, $t$ = {time:g} s"
        axes.annotate(note, place, xytext=(6, 6), textcoords="offset points", color=PURPLE, fontsize=12, zorder=7)
    if planned.via:
        handles.append(Line2D([], [], linestyle="", marker="D", markersize=8, color=PURPLE, label="via place"))
    return handles


def _extent(planned, driven):
    """(low, high) of everything that the map shows."""
    r = planned.radius
    places = [driven, planned.path[:, 1:3], planned.goal[None] - r, planned.goal[None] + r, driven[:1] - r, driven[:1] + r]
    places += [place[None] for place, _ in planned.via]
    places += [center[None] + sign * (radius + r) for center, radius in planned.keep_out for sign in (-1, 1)]
    if planned.follow is not None:
        places += [planned.follow[0] - planned.follow[1], planned.follow[0] + planned.follow[1]]
    everything = np.concatenate(places)
    return everything.min(axis=0), everything.max(axis=0)


def plan_path(run):
    """Draws the map of the task with the planned and the driven path."""
    planned = run.planned
    if planned is None:
        return None
    driven = np.asarray(run.state["position_W_m"][:, :2], dtype=float)
    low, high = _extent(planned, driven)
    margin = 0.05 * float((high - low).max())
    width = high - low + 2 * margin
    figure, (axes,) = blank_page((9.5, float(np.clip(9.5 * width[1] / width[0] + 1.6, 4.6, 10))))
    around = _draw_obstacles(axes, planned)
    if planned.follow is not None:
        around += _draw_band(axes, *planned.follow)
    paths = axes.plot(driven[:, 0], driven[:, 1], color=BLUE, linewidth=2.2, zorder=3, label="driven")
    if len(planned.path):
        paths += axes.plot(planned.path[:, 1], planned.path[:, 2], color=BLACK, linestyle=(0, (5, 4)), linewidth=1.2,
                           zorder=4, label="planned")
    for place in (driven[0], driven[-1]):
        axes.add_patch(Circle(place, planned.radius, facecolor="none", edgecolor=LIGHT_GREY, linewidth=1.2, zorder=1))
    places = _draw_goals(axes, planned)
    mark_ends(axes, driven[0], driven[-1])
    off = float(np.linalg.norm(driven[-1] - planned.goal))
    ends = [Line2D([], [], label="start", **hollow(BLACK, 9)),
            Line2D([], [], linestyle="", marker="s", markersize=8, color=BLACK,
                   label=f"end, {_length_text(off)} from the goal"),
            Line2D([], [], linestyle="", marker="o", markersize=12, markerfacecolor="none", color=LIGHT_GREY, label="ball")]
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    around += draw_patches(axes, run.patches)
    axes.set_xlabel("$z_1$ [m]")
    axes.set_ylabel("$z_2$ [m]")
    head(axes, run, "The plan from above", [paths + places, ends, around])
    return figure


def plan_need(run):
    """Draws the friction coefficient needed over time, planned and driven, with what the plan may use."""
    planned = run.planned
    if planned is None:
        return None
    figure, (axes,) = blank_page((9.5, 5.2))
    time = np.asarray(run.contact["time_s"], dtype=float)
    need = run.friction_required()
    finite = need[np.isfinite(need)]
    found = run.largest_friction_required()
    highest = found[0] if found and np.isfinite(found[0]) else float(finite.max(initial=_LEAST_NEED))
    planned_most = float(planned.path[:, 3].max()) if len(planned.path) else planned.need or highest
    apart = highest > _FAR_APART * planned_most
    shown = np.maximum(need, _LEAST_NEED) if apart else need
    rings = draw_ringing(axes, time, shown, VERMILLION if run.is_stepper else BLUE, 1.2)
    driven = Line2D([], [], color=VERMILLION if run.is_stepper else BLUE,
                    label=f"driven, at most {short_number(highest)}")
    handles = [driven]
    if len(planned.path):
        rows = planned.path
        axes.plot(rows[:, 0], np.maximum(rows[:, 3], _LEAST_NEED) if apart else rows[:, 3], color=BLACK,
                  linestyle=(0, (5, 4)), linewidth=1.4, zorder=4)
        handles.append(Line2D([], [], color=BLACK, linestyle=(0, (5, 4)), linewidth=1.4,
                              label=f"planned, at most {short_number(planned.need or planned_most)}"))
    limits, top = [], 1.3 * highest
    under = run.static_friction_under_ball()
    if under is not None:
        limits.append(draw_floor_friction(axes, run, under, planned.use, GREEN))
        limits.append(draw_floor_friction(axes, run, under, color=ORANGE))
        top = max(top, 1.1 * float(under[np.isfinite(under)].max(initial=0)))
    elif planned.friction_limit is not None:
        floor = run.static_friction_coefficient
        limits.append(axes.axhline(planned.friction_limit, color=GREEN, linestyle="--", linewidth=1.4,
                                   label=rf"a plan may use {short_number(planned.use)} $\mu_\mathrm{{s}}$ = "
                                         f"{short_number(planned.friction_limit)}"))
        limits.append(axes.axhline(floor, color=ORANGE, linestyle="--", linewidth=1.4,
                                   label=rf"the floor's $\mu_\mathrm{{s}}$ = {short_number(floor)}"))
        top = max(top, 1.1 * floor)
    if apart:
        axes.set_yscale("log")
        axes.set_ylim(_LEAST_NEED, 1.5 * top)
    else:
        axes.set_ylim(0, top)
    events = mark_events([axes], run)
    if apart:
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_ylabel(r"$f_\mathrm{s}/N$")
    finish_time_axis(axes, run)
    band = [ringing_legend()] if rings else []
    head(axes, run, "Friction coefficient needed, and what the plan may use", [handles + limits[:1], limits[1:] + band, *events])
    return figure
