"""The patches of a floor that changes with place, as scenario.toml beside the log has them."""

import math
import tomllib
from typing import NamedTuple

import numpy as np

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
