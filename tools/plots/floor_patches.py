"""Draws the patches of a floor that changes with place."""

import numpy as np
from matplotlib.patches import Circle, Patch, Polygon

from page import VERMILLION
from patches import KINDS, top_patch
from short_number import short_number


def _legend(kinds):
    return [Patch(facecolor=KINDS[kind][0], edgecolor="#B0B0B0", linewidth=0.8, label=KINDS[kind][1]) for kind in KINDS
            if kind in kinds]


def _move_inside(axes, note):
    """Moves a note that reaches beyond the left or right side of the axes."""
    words, view = note.get_window_extent(), axes.get_window_extent()
    edge = 0.01 * view.width
    over = max(view.x0 + edge - words.x0, 0) or min(view.x1 - edge - words.x1, 0)
    x, y = note.get_position()
    note.set_in_layout(False)  # it would push other axes away
    note.set_position((x + 72 * over / axes.figure.dpi, y))


def draw_patches(axes, patches):
    """Draws the patches under a path, once the view is set. Returns the legend entries of those in view."""
    axes.apply_aspect()
    (left, right), (lower, upper) = axes.get_xlim(), axes.get_ylim()
    edge = 0.02 * (upper - lower)
    low, high = np.array([left, lower]), np.array([right, upper])
    kinds = set()
    for number, patch in enumerate(patches):
        first, last = patch.extent()
        if np.any(last < low) or np.any(first > high):
            continue
        style = {"facecolor": KINDS[patch.kind][0], "edgecolor": "#B0B0B0", "linewidth": 0.8, "zorder": 0.2 + 0.001 * number}
        shape = Polygon(patch.corners, closed=True, **style) if patch.corners is not None else \
            Circle(patch.center, patch.radius, **style)
        axes.add_artist(shape)  # a shape of the data would widen the view
        shape.set_clip_path(axes.patch)
        kinds.add(patch.kind)
        # At the lower edge of the part in view, inside: the legend takes room from the upper one.
        place = (max(first[0], low[0]) + min(last[0], high[0])) / 2, max(first[1], low[1] + edge)
        if patch.text:
            note = axes.annotate(_symbols(patch.text), place, xytext=(0, 4), textcoords="offset points", ha="center", va="bottom",
                                 fontsize=11, color="#555555", zorder=2.5, annotation_clip=True)
            _move_inside(axes, note)
    return _legend(kinds)


def draw_floor_friction(axes, run, under, use=1.0, color=VERMILLION):
    """Draws `use` times mu_s under the ball, `under` at the samples of `state`. Returns its legend entry."""
    limit = use * np.where(np.isfinite(under), under, np.nan)
    line, = axes.plot(np.asarray(run.state["time_s"], dtype=float), limit, color=color, linestyle="--", linewidth=1.4,
                      drawstyle="steps-post", zorder=3)
    finite = limit[np.isfinite(limit)]
    values = [short_number(value) for value in (finite.min(), finite.max())] if len(finite) else []
    if np.isinf(under).any():
        values = [*values[:1], "perfect"]
    symbol = r"$\mu_\mathrm{s}$"
    name = f"{symbol} under the ball" if use == 1 else f"a plan may use {short_number(use)} {symbol}"
    line.set_label(f"{name}: {' to '.join(dict.fromkeys(values))}")
    return line


def shade_patches_along(axes, patches, places, distance):
    """Shades the distances of a straight path at which the ball is on a patch. Returns the legend entries."""
    if not patches or np.ptp(distance) == 0:
        return []
    order = np.argsort(distance, kind="stable")
    fine = np.linspace(distance[order[0]], distance[order[-1]], 2000)
    along = np.stack([np.interp(fine, distance[order], places[order, j]) for j in range(2)], axis=1)
    top = top_patch(patches, along)
    starts = np.flatnonzero(np.diff(top, prepend=-2))
    kinds = set()
    for start, end in zip(starts, [*starts[1:], len(top)]):
        if top[start] < 0:
            continue
        patch = patches[top[start]]
        axes.axhspan(fine[start], fine[min(end, len(fine) - 1)], facecolor=KINDS[patch.kind][0], zorder=0.2)
        kinds.add(patch.kind)
        if patch.text:
            axes.annotate(_symbols(patch.text), (1.0, fine[min(end, len(fine) - 1)]), xycoords=("axes fraction", "data"),
                          xytext=(-6, -4), textcoords="offset points", ha="right", va="top", fontsize=11, color="#555555")
    return _legend(kinds)


def _symbols(text):
    return text.replace("mu_s", r"$\mu_\mathrm{s}$").replace("c_rr", r"$c_\mathrm{rr}$")
