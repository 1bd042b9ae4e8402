"""The parts of a foxglove.SceneUpdate, as dicts for JSON. Lengths in m, in the frame of the entity."""

import math

import numpy as np

from foxglove_schemas import PRIMITIVES

LINE_STRIP, LINE_LOOP, LINE_LIST = range(3)
_IDENTITY = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
_DIGITS = 8  # of a coordinate: the drawing is exact to 1e-8 of its own size, and its text stays short


def stamp(time_us):
    return {"sec": time_us // 1_000_000, "nsec": time_us % 1_000_000 * 1000}


def vector(values):
    """A foxglove.Vector3 with every digit."""
    x, y, z = (float(value) for value in values)
    return {"x": x, "y": y, "z": z}


def quaternion(wxyz):
    """A foxglove.Quaternion with every digit."""
    w, x, y, z = (float(value) for value in wxyz)
    return {"x": x, "y": y, "z": z, "w": w}


def _short(values):
    return vector(float(f"{value:.{_DIGITS}g}") for value in values)


def pose(position=(0, 0, 0), orientation=None):
    return {"position": _short(position), "orientation": _IDENTITY if orientation is None else quaternion(orientation)}


def color(text, opacity=1.0):
    """A foxglove.Color from "#rrggbb"."""
    r, g, b = (int(text[i:i + 2], 16) / 255 for i in (1, 3, 5))
    return {"r": round(r, 4), "g": round(g, 4), "b": round(b, 4), "a": opacity}


def entity(name, frame, time_us, **primitives):
    """A foxglove.SceneEntity that stays until the next of its name, and goes along with its frame."""
    return {"timestamp": stamp(time_us), "frame_id": frame, "id": name, "lifetime": {"sec": 0, "nsec": 0},
            "frame_locked": True, "metadata": [], **{key: primitives.get(key, []) for key in PRIMITIVES}}


def sphere(radius, tint, position=(0, 0, 0)):
    return {"pose": pose(position), "size": _short([2 * radius] * 3), "color": tint}


def box(low, high, tint):
    """A box along the axes, from corner to corner."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    return {"pose": pose((low + high) / 2), "size": _short(high - low), "color": tint}


def cylinder(center, radius, height, tint, bottom_scale=1.0):
    """A cylinder along z. With bottom_scale 0 it is a cone with its apex below."""
    return {"pose": pose(center), "size": _short([2 * radius, 2 * radius, height]), "bottom_scale": bottom_scale,
            "top_scale": 1.0, "color": tint}


def line(kind, points, tint, thickness, in_pixels=False):
    return {"type": kind, "pose": pose(), "thickness": thickness, "scale_invariant": in_pixels,
            "points": [_short(point) for point in points], "color": tint, "colors": [], "indices": []}


def triangles(points, indices, tint):
    return {"pose": pose(), "points": [_short(point) for point in points], "color": tint, "colors": [],
            "indices": [int(index) for index in indices]}


def text(words, position, size, tint):
    return {"pose": pose(position), "billboard": True, "font_size": size, "scale_invariant": False, "color": tint,
            "text": words}


def arrow(along, width, tint):
    """An arrow from the origin to `along`, which is not 0."""
    length = float(np.linalg.norm(along))
    head = min(4 * width, 0.5 * length)
    return {"pose": pose(orientation=turn_of_x_to(np.asarray(along) / length)), "shaft_length": length - head,
            "shaft_diameter": width, "head_length": head, "head_diameter": min(2.5 * width, 1.2 * head), "color": tint}


def turn_of_x_to(direction):
    """The shortest turn of (1, 0, 0) to a unit vector, as a quaternion w, x, y, z."""
    w = 1 + direction[0]
    if w < 1e-12:
        return 0.0, 0.0, 0.0, 1.0  # half a turn about z
    found = np.array([w, 0.0, -direction[2], direction[1]])
    return found / np.linalg.norm(found)


def circle(radius, first, second, count):
    """(count, 3): points around the origin, in the plane of two orthogonal unit vectors."""
    angle = 2 * math.pi * np.arange(count)[:, None] / count
    return radius * (np.cos(angle) * np.asarray(first, dtype=float) + np.sin(angle) * np.asarray(second, dtype=float))


def octants(radius, parts):
    """(points, indices): every second octant of a sphere in triangles, each edge in `parts` parts."""
    points, indices = [], []
    for x, y, z in ((1, 1, 1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)):
        rows, first = [], len(points)
        for i in range(parts + 1):
            rows.append(first + i * (i + 1) // 2)
            for j in range(i + 1):
                place = np.array([x * (i - j), y * j, z * (parts - i)], dtype=float)
                points.append(radius * place / np.linalg.norm(place))
        for i in range(parts):
            for j in range(i + 1):
                indices += [rows[i] + j, rows[i + 1] + j, rows[i + 1] + j + 1]
                if j < i:
                    indices += [rows[i] + j, rows[i + 1] + j + 1, rows[i] + j + 1]
    return np.array(points), indices


def _cross(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def triangulate(corners):
    """Indices of the triangles of a polygon (n, 2), whose border does not cross itself, by cutting off ears."""
    ring = list(range(len(corners)))
    if sum(_cross(corners[0], corners[i], corners[i - 1]) for i in ring) > 0:
        ring.reverse()  # to the left from here on
    found = []
    while len(ring) > 3:
        cut = _ear(corners, ring)
        found += [ring[cut - 1], ring[cut], ring[(cut + 1) % len(ring)]]
        del ring[cut]
    return found + ring


def _ear(corners, ring):
    """The place in `ring` of a corner whose triangle with its neighbours lies inside the polygon and holds no other.

    Rounding may hide every ear of a thin polygon; the corner with the greatest angle to the left is taken then.
    """
    best, widest = 0, -math.inf
    for k in range(len(ring)):
        a, b, c = (corners[ring[(k + step) % len(ring)]] for step in (-1, 0, 1))
        area = _cross(a, b, c)
        others = (corners[i] for i in ring if i not in (ring[k - 1], ring[k], ring[(k + 1) % len(ring)]))
        if area > 0 and not any(min(_cross(a, b, p), _cross(b, c, p), _cross(c, a, p)) >= 0 for p in others):
            return k
        if area > widest:
            best, widest = k, area
    return best
