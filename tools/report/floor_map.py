"""A piece of the floor from above, as SVG to scale: the base of the report's maps."""

import html

import numpy as np

from floor_patches import KINDS

_WIDTH = 1000  # of the drawing; lengths in it are pixels at that width
_TALLEST, _LEAST = 620, 260
_MARGIN = 0.05  # of the greater extent
_ROOM_BELOW = 30  # for the numbers of the axis
_ROOM_LEFT = 54
_TEXT_HEIGHT = 15
_MOST_POINTS = 2000


def thinned(points):
    """The points of a line that are drawn: all of a short one."""
    return points[:: max(1, len(points) // _MOST_POINTS)]


def key(name, text):
    """An entry of a map's legend. `name` is the class of what it stands for."""
    return f'<span><i class="key {name}"></i>{html.escape(text)}</span>'


class FloorMap:
    """Shows at least the places from `low` to `high`, and the patches of the floor."""

    def __init__(self, low, high, patches=()):
        self._patches = patches
        margin = _MARGIN * (float((high - low).max()) or 1.0)
        low, high = low - margin, high + margin
        self._scale = min((_WIDTH - _ROOM_LEFT) / (high[0] - low[0]), (_TALLEST - _ROOM_BELOW) / (high[1] - low[1]))
        self._height = float(np.clip((high[1] - low[1]) * self._scale + _ROOM_BELOW, _LEAST, _TALLEST))
        middle = (low + high) / 2
        self._origin = np.array([_ROOM_LEFT + (_WIDTH - _ROOM_LEFT) / 2, (self._height - _ROOM_BELOW) / 2]) - \
            self._scale * middle * (1, -1)

    def _at(self, place):
        return self._origin + self._scale * np.asarray(place, dtype=float) * (1, -1)

    def _line(self, points, name):
        places = " ".join(f"{x:.1f},{y:.1f}" for x, y in (self._at(point) for point in points))
        return f'<polyline class="{name}" points="{places}"/>'

    def _circle(self, place, radius, name, title=""):
        x, y = self._at(place)
        note = f"<title>{html.escape(title)}</title>" if title else ""
        return f'<circle class="{name}" cx="{x:.1f}" cy="{y:.1f}" r="{radius * self._scale:.1f}">{note}</circle>'

    def _patch(self, patch):
        name = f"patch {patch.kind}"
        if patch.corners is None:
            return self._circle(patch.center, patch.radius, name, patch.text)
        places = " ".join(f"{x:.1f},{y:.1f}" for x, y in (self._at(corner) for corner in patch.corners))
        return f'<polygon class="{name}" points="{places}"><title>{html.escape(patch.text)}</title></polygon>'

    def _patch_kinds(self):
        """Entries of the legend."""
        kinds = {patch.kind for patch in self._patches}
        return [(f"patch {kind}", text) for kind, (_, text) in KINDS.items() if kind in kinds]

    def _grid(self):
        """Lines at round coordinates with their numbers."""
        span = (_WIDTH - _ROOM_LEFT) / self._scale
        unit = 10 ** np.floor(np.log10(span / 4))
        step = unit * max(factor for factor in (1, 2, 5) if factor * unit <= span / 4)
        bottom = self._height - _ROOM_BELOW
        (left, low), (right, high) = ((np.array([_ROOM_LEFT, bottom]) - self._origin) * (1, -1) / self._scale,
                                      (np.array([_WIDTH, 0]) - self._origin) * (1, -1) / self._scale)
        parts = []
        for k in range(int(np.ceil(left / step)), int(np.floor(right / step)) + 1):
            x = self._at((k * step, 0))[0]
            parts.append(f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{bottom:.1f}"/>'
                         f'<text x="{x:.1f}" y="{bottom + 20:.1f}" text-anchor="middle">{k * step:g}</text>')
        for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1):
            y = self._at((0, k * step))[1]
            parts.append(f'<line class="grid" x1="{_ROOM_LEFT}" x2="{_WIDTH}" y1="{y:.1f}" y2="{y:.1f}"/>'
                         f'<text x="{_ROOM_LEFT - 8}" y="{max(y + 5, _TEXT_HEIGHT):.1f}" text-anchor="end">{k * step:g}</text>')
        return "".join(parts)

    def _drawing(self, name, label, parts):
        """The SVG. `data-` has what a script needs to place something: pixel = x + scale * e1, y - scale * e2."""
        frame = f'data-scale="{self._scale!r}" data-x="{self._origin[0]!r}" data-y="{self._origin[1]!r}"'
        floor = [*map(self._patch, self._patches), self._grid()]
        return (f'<svg id="{name}" viewBox="0 0 {_WIDTH} {self._height:.0f}" role="img" {frame} '
                f'aria-label="{html.escape(label)}">{"".join([*floor, *parts])}</svg>')
