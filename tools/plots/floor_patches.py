"""The patches of a floor that changes with place, as scenario.toml beside the log has them, and how they are drawn."""

import math
import tomllib
from typing import NamedTuple

import numpy as np
from matplotlib.patches import Circle, Patch, Polygon

from page import VERMILLION
from short_number import short_number

# The kinds of patches, against the floor: shade, and words of the legend.
KINDS = {
    "slippery": ("#CFE6F5", "less friction than the floor"),
    "rough": ("#F3DFE9", "more friction than the floor"),
    "resists": ("#F2E6CF", "more rolling resistance than the floor"),
    "smooth": ("#DDF0E6", "less rolling resistance than the floor"),
    "alike": ("#EDEDED", "a patch like the floor"),
}


class FloorPatch(NamedTuple):
    """Lengths in m. `corners` is (n, 2); of a circle None."""

    corners: np.ndarray | None
    center: np.ndarray | None
    radius: float
    kind: str  # of KINDS
    static_friction: float  # infinite: perfect
    text: str  # what differs from the floor, e.g. "mu_s 0.1, c_rr 0.05"

    def holds(self, places):
        """Whether each of the places (n, 2) is on the patch."""
        if self.corners is None:
            return np.linalg.norm(places - self.center, axis=1) <= self.radius
        inside = np.zeros(len(places), dtype=bool)
        x, y = places[:, 0], places[:, 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            for (x0, y0), (x1, y1) in zip(np.roll(self.corners, 1, axis=0), self.corners):
                inside ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
        return inside

    def extent(self):
        """(low, high)."""
        if self.corners is None:
            return self.center - self.radius, self.center + self.radius
        return self.corners.min(axis=0), self.corners.max(axis=0)


def _number(table, key, otherwise):
    value = table.get(key)
    return float(value) if isinstance(value, (int, float)) else otherwise


def _patch(entry, floor):
    mu_floor, resistance_floor = _number(floor, "static_friction", math.inf), _number(floor, "rolling_resistance", 0.0)
    mu, resistance = _number(entry, "static_friction", mu_floor), _number(entry, "rolling_resistance", resistance_floor)
    kind = ("slippery" if mu < mu_floor else "rough" if mu > mu_floor else
            "resists" if resistance > resistance_floor else "smooth" if resistance < resistance_floor else "alike")
    parts = [f"mu_s {short_number(mu) if math.isfinite(mu) else 'perfect'}"] if mu != mu_floor else []
    parts += [f"c_rr {short_number(resistance)}"] if resistance != resistance_floor else []
    if "circle" in entry:
        circle = entry["circle"]
        return FloorPatch(None, np.array(circle["center"], dtype=float), float(circle["radius"]), kind, mu, ", ".join(parts))
    corners = np.array(entry["polygon"], dtype=float).reshape(-1, 2)
    return FloorPatch(corners, None, 0.0, kind, mu, ", ".join(parts))


def read_patches(folder):
    """The patches in the order of the file, in which later ones cover earlier ones. None is no error."""
    try:
        surface = tomllib.loads((folder / "scenario.toml").read_text(encoding="utf-8")).get("surface", {})
        return [_patch(entry, surface) for entry in surface.get("patch", [])]
    except (OSError, ValueError, KeyError, TypeError, AttributeError):  # tomllib's errors are ValueErrors
        return []


def top_patch(patches, places):
    """Per place the index of the patch that counts; -1 on the floor between them."""
    found = np.full(len(places), -1)
    for number, patch in enumerate(patches):
        found[patch.holds(places)] = number
    return found


def static_friction_at(patches, places, floor):
    """mu_s at each of the places (n, 2); `floor` between the patches."""
    of_index = np.array([floor, *(patch.static_friction for patch in patches)], dtype=float)
    return of_index[top_patch(patches, places) + 1]


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
