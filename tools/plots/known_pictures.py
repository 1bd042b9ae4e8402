"""The pictures of what the robot knew: its estimate with the band, what it measured, and what its belief predicted. Each
function returns None for a run without."""

import math

import numpy as np
from matplotlib import ticker
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch

from floor_patches import draw_floor_friction, draw_patches
from known import BAND_NAME, BAND_SIGMAS, BIAS_MEAN_S
from page import (BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILLION, draw_ringing, finish_time_axis, head, hollow,
                  legend_above, mark_events, ringing_legend, rows_along, widen_flat)
from short_number import short_number

_BAND_ALPHA = 0.2
_FLAG_COLORS = {"slip": VERMILLION, "light": PURPLE}
_FLAG_NAMES = {"slip": "slip flagged", "light": "light contact flagged"}
# A band reaches at most this many times as far as the curves in it: a wide band would flatten them.
_BAND_IN_SIGHT = 2.5
_CIRCLES_ALONG = 120
_COMPONENTS = (BLUE, VERMILLION, GREEN)


def percent(share):
    return "\u2013" if not np.isfinite(share) else f"{100 * share:.0f} %"


def _quality(track, unit):
    """How large the error was and how much of it the band explains, as one legend entry."""
    return Line2D([], [], linestyle="", label=f"rms {short_number(track.rms())}{unit}, {percent(track.inside())} inside "
                                              f"{BAND_NAME}")


def _draw_band(axes, time, low, high, color):
    axes.fill_between(time, low, high, color=color, alpha=_BAND_ALPHA, linewidth=0, zorder=1.2)


def _limit(axes, curves, low, high):
    """Vertical limits that show the curves and, as far as it does not flatten them, the band."""
    finite = np.concatenate([np.ravel(curve)[np.isfinite(np.ravel(curve))] for curve in curves])
    band = np.concatenate([np.ravel(edge)[np.isfinite(np.ravel(edge))] for edge in (low, high)])
    if not len(finite) or not len(band):
        return
    least, most = finite.min(), finite.max()
    reach = _BAND_IN_SIGHT * max(most - least, 1e-12 * max(abs(most), 1))
    if most == least:  # nothing but the band can be seen
        reach = np.inf
    least, most = min(least, max(band.min(), least - reach)), max(most, min(band.max(), most + reach))
    margin = 0.06 * (most - least) or 1.0
    axes.set_ylim(least - margin, most + margin)
    widen_flat(axes)


def _draw_error(axes, time, track, names, unit):
    """Errors around 0 with the band that the robot states. Returns the legend rows."""
    edge = BAND_SIGMAS * track.sigma
    _draw_band(axes, time, -edge, edge, GREY)
    axes.axhline(0, color=GREY, linewidth=0.6)
    handles = []
    for j, name in enumerate(names):
        handles += axes.plot(time, track.error[:, j], color=_COMPONENTS[j], linewidth=1.1, label=name)
    _limit(axes, [track.error], -edge, edge)
    return [handles + [Patch(color=GREY, alpha=0.4, label=BAND_NAME)], [_quality(track, unit)]]


def _tilt(axes, _, estimate):
    axes.set_ylabel("tilt error [\u00b0]")
    return _draw_error(axes, estimate.time_s, estimate.tilt_deg, ("about $e_1$", "about $e_2$"), "\u00b0")


def _yaw(axes, _, estimate):
    axes.set_ylabel("yaw error [\u00b0]")
    return _draw_error(axes, estimate.time_s, estimate.yaw_deg, ("about $e_3$",), "\u00b0")


def _place(axes, _, estimate):
    axes.set_ylabel("place error [m]")
    return _draw_error(axes, estimate.time_s, estimate.place_error_m, ("along $e_1$", "along $e_2$"), " m")


def _bias(axes, run, estimate):
    axes.set_ylabel("gyro bias [\u00b0/s]")
    track, time = estimate.bias_degps, estimate.time_s
    edge = (BAND_SIGMAS * track.sigma)[:, None]
    handles = []
    for j, color in enumerate(_COMPONENTS):
        _draw_band(axes, time, (track.value - edge)[:, j], (track.value + edge)[:, j], color)
        handles += axes.plot(time, track.value[:, j], color=color, linewidth=1.1, label=f"$b_{j + 1}$")
        axes.plot(time, track.truth[:, j], color=color, linewidth=1.1, linestyle=(0, (4, 3)))
    truth = Line2D([], [], color=GREY, linestyle=(0, (4, 3)), label=f"true, mean of {BIAS_MEAN_S} s")
    _limit(axes, [track.value, track.truth], track.value - edge, track.value + edge)
    off = (run.summary.get("estimate") or {}).get("gyro_bias_error")
    note = [] if off is None else [Line2D([], [], linestyle="", label=f"off by {short_number(math.degrees(off))}\u00b0/s at the end")]
    return [handles + [truth, Patch(color=GREY, alpha=0.4, label=BAND_NAME)], note]


def _draw_flags(axes, measured):
    """Strips along the upper edge. Returns the legend entries."""
    for flag in measured.flags:
        least = 0.004 * float(measured.time_s[-1])  # or a short one could not be seen
        axes.axvspan(flag.start_s, max(flag.end_s, flag.start_s + least), ymin=0.955, color=_FLAG_COLORS[flag.what],
                     linewidth=0, zorder=4)
    return [Patch(color=_FLAG_COLORS[what], label=f"{_FLAG_NAMES[what]} {number}\u00d7")
            for what in _FLAG_NAMES if (number := sum(flag.what == what for flag in measured.flags))]


def _draw_measured(axes, measured, track, label, top=math.inf):
    truth, value, edge = track.truth[:, 0], track.value[:, 0], BAND_SIGMAS * track.sigma
    _draw_band(axes, measured.time_s, np.minimum(value - edge, top), np.minimum(value + edge, top), GREEN)
    # The truth comes last and thin: where the masses ring, it would be hidden.
    line, = axes.plot(measured.time_s, np.minimum(value, top), color=GREEN, linewidth=1.1, label="measured")
    axes.plot(measured.time_s, np.minimum(truth, top), color=BLACK, linewidth=0.5)
    axes.set_ylabel(label)
    _limit(axes, [np.minimum(value, top), np.minimum(truth, top)], np.minimum(value - edge, top), np.minimum(value + edge, top))
    _draw_flags(axes, measured)
    return [[Line2D([], [], color=BLACK, linewidth=0.8, label="true"), line, Patch(color=GREEN, alpha=0.4, label=BAND_NAME)]]


def _need(axes, run, _):
    measured = run.measured
    finite = measured.need.truth[np.isfinite(measured.need.truth)]
    # Near N = 0 the ratio grows without bound, and an axis up to there would flatten everything else.
    top = 4 * float(np.percentile(finite, 95)) if len(finite) else math.inf
    return _draw_measured(axes, measured, measured.need, r"$f_\mathrm{s}/N$", top or math.inf)


def _normal(axes, run, _):
    return _draw_measured(axes, run.measured, run.measured.normal_n, "$N$ [N]")


def _need_error(axes, run, _):
    axes.set_ylabel(r"$f_\mathrm{s}/N$, error")
    return _draw_error(axes, run.measured.time_s, run.measured.need, ("measured less true",), "")


def _normal_error(axes, run, _):
    axes.set_ylabel("$N$, error [N]")
    return _draw_error(axes, run.measured.time_s, run.measured.normal_n, ("measured less true",), " N")


def _slip(axes, run, _):
    measured = run.measured
    edge = BAND_SIGMAS * measured.slip_sigma_mps2
    # The band is that of noise alone: slip is what stands out of it.
    _draw_band(axes, measured.time_s, np.zeros_like(edge), edge, GREY)
    line, = axes.plot(measured.time_s, measured.slip_mps2, color=BLACK, linewidth=1.0, label="measured")
    axes.set_ylabel("slip [m/s$^2$]")
    axes.set_ylim(bottom=0)
    return [[line, Patch(color=GREY, alpha=0.4, label=f"noise, up to {BAND_SIGMAS}\u03c3")], _draw_flags(axes, measured)]


def _draw_place_band(axes, place, sigma, color):
    """The places within the band, as circles along the path: the stated sigma is that of the worst direction."""
    rows = np.flatnonzero(np.isfinite(place).all(axis=1) & np.isfinite(sigma))
    if not len(rows):
        return
    rows = np.unique(np.append(rows[rows_along(place[rows], _CIRCLES_ALONG)], rows[-1]))
    circles = [Circle(place[row], BAND_SIGMAS * sigma[row]) for row in rows]
    # Opaque and light: where circles overlap, the band must not be darker.
    axes.add_collection(PatchCollection(circles, facecolor=color, edgecolor="none", zorder=1.2))
    axes.add_patch(Circle(place[rows[-1]], BAND_SIGMAS * sigma[rows[-1]], fill=False, edgecolor=GREEN, linewidth=1.2,
                          linestyle=(0, (3, 2)), zorder=1.4))


def _equal_scale(axes, places, margin):
    everything = np.concatenate([place[np.isfinite(place).all(axis=1)] for place in places])
    low, high = everything.min(axis=0), everything.max(axis=0)
    margin += 0.07 * float((high - low).max()) or 1e-3
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_xlabel("$z_1$ [m]")
    axes.set_ylabel("$z_2$ [m]")


def _path(axes, _, estimate):
    track = estimate.place_m
    _draw_place_band(axes, track.value, track.sigma, "#D9EFE8")
    true, = axes.plot(track.truth[:, 0], track.truth[:, 1], color=BLACK, linewidth=1.6, label="true path", zorder=3)
    seen, = axes.plot(track.value[:, 0], track.value[:, 1], color=GREEN, linewidth=1.4, linestyle=(0, (5, 3)),
                      label="estimated", zorder=3.5)
    axes.plot(*track.truth[-1], marker="s", markersize=6, color=BLACK, zorder=4)
    axes.plot(*track.value[-1], marker="s", markersize=6, color=GREEN, zorder=4)
    edge = BAND_SIGMAS * track.sigma[np.isfinite(track.sigma)]
    _equal_scale(axes, (track.truth, track.value), float(edge.max(initial=0)))
    off = float(np.linalg.norm(track.error[-1]))
    note = Line2D([], [], linestyle="", label=f"at the end {short_number(off)} m apart")
    return [[true, seen, Patch(color="#D9EFE8", label=BAND_NAME)], [note]]


def estimate(run):
    """Draws truth, estimate and band, and the contact force that the robot measures; None where it does neither."""
    found, measured = run.estimate, run.measured
    panels = [_need, _need_error, _normal, _normal_error] if measured is not None else []
    panels += [_tilt, _yaw, _bias, _place] if found is not None else []
    panels += [_slip] if measured is not None else []
    over_time = len(panels)
    panels += [_path] if found is not None else []
    if not panels:
        return None
    rows = (len(panels) + 1) // 2
    figure = Figure(figsize=(14, 1.0 + 3.5 * rows), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12, hspace=0.04, wspace=0.03)
    grid = figure.subplots(rows, 2, squeeze=False)
    axes_of = list(grid.flat)
    events = mark_events(axes_of[:over_time], run)
    for k, (draw, axes) in enumerate(zip(panels, axes_of)):
        legend = draw(axes, run, found)
        if k < over_time:
            finish_time_axis(axes, run)
            axes.xaxis.set_major_locator(ticker.MaxNLocator(6))
            if k + 2 < len(panels):
                axes.set_xlabel("")  # the lowest one has it
        if k == 0:
            head(axes, run, "What the robot knew: truth, estimate and band", [*events, *legend], name_axes=axes_of[1])
        else:
            # The layout leaves room for a title, not for a legend.
            axes.set_title(" ", fontsize=4, pad=4 + legend_above(axes, legend))
    for axes in axes_of[len(panels):]:
        axes.remove()
    return figure


def belief(run):
    """Draws what the believed robot would have done beside what the real one did; None where only the truth is believed."""
    predicted = run.predicted
    if predicted is None:
        return None
    figure = Figure(figsize=(14, 9.6), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.12, h_pad=0.12, hspace=0.04, wspace=0.03)
    grid = figure.subplots(2, 2)
    over_time = [grid[0, 0], grid[0, 1], grid[1, 0]]
    events = mark_events(over_time, run)
    time, ringing = np.asarray(run.contact["time_s"], dtype=float), False
    pairs = ((run.contact["normal_force_n"], predicted.normal_n, "$N$ [N]"),
             (run.contact["static_friction_n"], predicted.friction_n, r"$f_\mathrm{s}$ [N]"),
             (run.friction_required(), predicted.need, r"$f_\mathrm{s}/N$"))
    for axes, (real, believed, label) in zip(over_time, pairs):
        ringing = draw_ringing(axes, time, real, BLUE, 1.1) or ringing
        axes.plot(predicted.time_s, believed, color=ORANGE, linewidth=1.6)
        widen_flat(axes)
        axes.set_ylabel(label)
        finish_time_axis(axes, run)
        axes.xaxis.set_major_locator(ticker.MaxNLocator(6))
    both = np.concatenate([pairs[2][0], pairs[2][1]])
    usual = 4 * float(np.nanpercentile(both, 90)) if np.isfinite(both).any() else 0
    if over_time[2].get_ylim()[1] > usual > 0:  # near N = 0 the ratio grows without bound and would flatten the rest
        over_time[2].set_ylim(0, usual)
    under = run.static_friction_under_ball()
    limit = []
    if under is not None:
        limit = [draw_floor_friction(over_time[2], run, under)]
    curves = [Line2D([], [], color=BLUE, label="the real robot"), Line2D([], [], color=ORANGE, label="the believed robot")]
    head(grid[0, 0], run, "What belief and truth make of the same motion",
         [curves + ([ringing_legend()] if ringing else []), limit, *events], name_axes=grid[0, 1])
    axes, real = grid[1, 1], np.asarray(run.state["position_W_m"][:, :2], dtype=float)
    axes.plot(real[:, 0], real[:, 1], color=BLUE, linewidth=1.6)
    axes.plot(predicted.place_m[:, 0], predicted.place_m[:, 1], color=ORANGE, linewidth=1.6, linestyle=(0, (5, 3)))
    axes.plot(*real[0], zorder=5, **hollow(BLACK, 8))
    axes.plot(*real[-1], marker="s", markersize=7, color=BLUE, zorder=5)
    axes.plot(*predicted.place_m[-1], marker="s", markersize=7, color=ORANGE, zorder=5)
    _equal_scale(axes, (real, predicted.place_m), 0.0)
    floor = draw_patches(axes, run.patches)
    row = int(np.argmin(np.abs(run.state["time_s"] - predicted.time_s[-1])))
    off = float(np.linalg.norm(real[row] - predicted.place_m[-1]))
    legend_above(axes, [[Line2D([], [], linestyle="", label=f"{short_number(off)} m apart at "
                                                            f"$t$ = {short_number(float(predicted.time_s[-1]))} s")], floor])
    return figure
