"""Draws a run for Foxglove's 3-D panel, sample by sample: frames, the robot, the contact force, floor and path.

Frames, each inside the one before unless it says another. Axes are right-handed, lengths in m.
    world    z is the vertical; the origin is the floor's
    floor    e1 and e2 in the floor, e3 its normal; the origin lies on the floor
    space    the space frame of the messages: `floor`, raised by the ball's radius
    ball     in `space`: the body frame; the origin is the geometric centre
    mass_0   in `ball`: origin at mass 0, axes of the ball; likewise mass_1, ...
    contact  in `floor`: the place of the floor under the ball, axes of the floor

When Foxglove seeks, it takes the newest message of each topic. So every frame has a topic of its own, and what does not
change is on a topic with one message.
"""

import math
from typing import NamedTuple

import numpy as np

import ballast
import foxglove_shapes as shapes
from foxglove_schemas import FRAME, SCENE
from patches import KINDS
from short_number import short_number
from thinned_path import ThinnedPath

TOPIC_FRAMES = "/frames/"  # and the name of the frame
TOPIC_FIXED, TOPIC_CONTACT, TOPIC_FLOOR = "/scene/fixed", "/scene/contact", "/scene/floor"

# Lengths in ball radii, as in the replay of `ballast report`:
WEIGHT_ARROW = 1.15   # arrow of the contact force of a ball at rest
LONGEST_ARROW = 2.6   # impacts and jumps are cut off there
HEAVIEST_MASS, LEAST_MASS = 0.115, 0.045  # radius; in between it goes with the cube root of the mass
CONE_SLANT = 1.3

_FLOOR_EVERY_US = 250_000
_PATH_POINTS = 400
_PATH_STEP = 0.02        # ball radii between points of a short path
_LAYER = 2e-3            # ball radii between floor, patches and lines on them, so that they do not flicker
_MASS_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f", "#6b4c1e")
_SHELL, _FLOOR, _GRID, _PLAN, _TEXT = "#3d74ad", "#d5dbe1", "#8695a5", "#8e4585", "#808080"
_PATH_COLORS = {ballast.contact_t.REGIME_ROLLING: "#1f7a74", ballast.contact_t.REGIME_SLIDING: "#d55e00",
                ballast.contact_t.REGIME_FLIGHT: "#56b4e9"}
_REGIMES = {ballast.contact_t.REGIME_ROLLING: "rolling", ballast.contact_t.REGIME_SLIDING: "sliding",
            ballast.contact_t.REGIME_FLIGHT: "flight"}
# The colour of the force by the share of mu_s N that is used.
_SHARE_COLORS = np.array([[0.0, 0.62, 0.35], [0.95, 0.75, 0.0], [0.85, 0.1, 0.1]])


class Sample(NamedTuple):
    """One instant of a run. Vectors are arrays; W is the space frame."""

    time_us: int  # of the timeline, >= 0
    run_id: int  # on a bus the number of the run; in logs 0
    tick: int
    orientation: np.ndarray  # w, x, y, z: body -> space
    position_W: np.ndarray
    masses_B: np.ndarray  # (n, 3)
    center_of_mass_B: np.ndarray
    force_W: np.ndarray  # of the floor on the ball, N
    mu_required: float
    margin: float
    regime: int

    @property
    def in_contact(self):
        return self.regime != ballast.contact_t.REGIME_FLIGHT


def sample_of(time_us, contact, state):
    """The sample of two messages of one tick, as rows of numpy arrays. None if they cannot be drawn."""
    count = int(state["mass_count"])
    if not 0 <= count <= len(state["mass_position_B_m"]) or int(contact["regime"]) not in _REGIMES:
        return None
    sample = Sample(time_us, int(state["run_id"]), int(state["tick"]), *(np.array(value, dtype=float) for value in (
        state["orientation"], state["position_W_m"], state["mass_position_B_m"][:count], state["center_of_mass_B_m"],
        [*contact["friction_force_W_n"], contact["normal_force_n"]])),
        float(contact["mu_required"]), float(contact["margin"]), int(contact["regime"]))
    finite = all(np.isfinite(part).all() for part in sample[3:8])
    return sample if finite and abs(np.linalg.norm(sample.orientation) - 1) < 1e-6 else None


def slope_quaternion(angle, downhill):
    """The orientation of the floor in a frame whose z is the vertical, w, x, y, z.

    It turns the floor's e3 away from the vertical towards `downhill`, so that gravity, (sin a cos d, sin a sin d, -cos a) in
    the floor, becomes (0, 0, -1).
    """
    return math.cos(angle / 2), -math.sin(downhill) * math.sin(angle / 2), \
        math.cos(downhill) * math.sin(angle / 2), 0.0


def _round_length(value):
    """1, 2 or 5 times a power of ten, at least `value`."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= value * (1 - 1e-9))


class _Path(ThinnedPath):
    """The places of the ball's lowest point in the frame `floor`, tagged with the regime."""

    def stretches(self):
        """(regime, points) from each change of regime to the next, and to the newest place."""
        found = []
        for point, regime in [*zip(self.points, self.tags), self.newest]:
            if not found or regime != found[-1][0]:
                found.append((regime, [*found[-1][1][-1:], point] if found else [point]))
            else:
                found[-1][1].append(point)
        return [(regime, points) for regime, points in found if len(points) > 1]


def _words(sample):
    """"rolling, N = 3.78 N, f_s/N = 0.116, margin 67 %"."""
    words = [_REGIMES[sample.regime]]
    if sample.in_contact:
        words.append(f"N = {short_number(sample.force_W[2])} N")
        if math.isfinite(sample.mu_required):
            words.append(f"f_s/N = {short_number(sample.mu_required)}")
        if math.isfinite(sample.margin):
            words.append(f"margin {100 * sample.margin:.0f} %")
    return ", ".join(words)


class RunScene:
    """Turns the samples of a run into messages. The samples of a next run may follow: the robot is the same."""

    def __init__(self, robot):
        self._robot = robot
        self._start()

    @property
    def topics(self):
        """(topic, schema name) of all messages."""
        frames = ["floor", "space", "contact", "ball", *(f"mass_{i}" for i in range(len(self._robot.masses)))]
        return [*((TOPIC_FRAMES + name, FRAME) for name in frames),
                *((topic, SCENE) for topic in (TOPIC_FIXED, TOPIC_CONTACT, TOPIC_FLOOR))]

    def _start(self):
        self._run_id = self._tick = None
        self._next_floor_us = 0
        self._path = _Path(_PATH_STEP * self._robot.radius, _PATH_POINTS)

    def messages(self, sample, is_last=False):
        """[(topic, schema name, message as a dict)] of a sample. `is_last` draws all, whenever it was drawn before."""
        found = []
        if self._tick is not None and (sample.run_id != self._run_id or sample.tick < self._tick):
            self._start()
        if self._tick is None:
            found += self._fixed_frames(sample.time_us)
            found.append((TOPIC_FIXED, SCENE, self._fixed_scene(sample.time_us)))
        self._run_id, self._tick = sample.run_id, sample.tick
        found += self._moving_frames(sample)
        found.append((TOPIC_CONTACT, SCENE, self._contact_scene(sample)))
        r = self._robot.radius
        self._path.add(sample.position_W + (0, 0, _LAYER * r), sample.regime)
        if is_last or sample.time_us >= self._next_floor_us:
            self._next_floor_us = sample.time_us + _FLOOR_EVERY_US
            found.append((TOPIC_FLOOR, SCENE, self._floor_scene(sample.time_us)))
        return found

    def matches(self, sample):
        return len(sample.masses_B) == len(self._robot.masses)

    # Frames

    @staticmethod
    def _frame(time_us, parent, child, translation, rotation=(1, 0, 0, 0)):
        message = {"timestamp": shapes.stamp(time_us), "parent_frame_id": parent, "child_frame_id": child,
                   "translation": shapes.vector(translation), "rotation": shapes.quaternion(rotation)}
        return TOPIC_FRAMES + child, FRAME, message

    def _fixed_frames(self, time_us):
        return [self._frame(time_us, "world", "floor", (0, 0, 0), slope_quaternion(*self._robot.slope)),
                self._frame(time_us, "floor", "space", (0, 0, self._robot.radius))]

    def _moving_frames(self, sample):
        x, y, _ = sample.position_W
        return [self._frame(sample.time_us, "floor", "contact", (x, y, 0)),
                self._frame(sample.time_us, "space", "ball", sample.position_W, sample.orientation),
                *(self._frame(sample.time_us, "ball", f"mass_{i}", place) for i, place in enumerate(sample.masses_B))]

    # Scenes

    @staticmethod
    def _scene(*entities):
        return {"deletions": [], "entities": list(entities)}

    def _fixed_scene(self, time_us):
        return self._scene(self._shell(time_us), self._rails(time_us), *self._masses(time_us), self._patches(time_us),
                           *self._plan(time_us))

    def _shell(self, time_us):
        """A sphere through which the masses are seen. Great circles and every second octant show how it rolls."""
        r = self._robot.radius
        points, indices = shapes.octants(r, 6)
        axes = np.eye(3)
        rings = [shapes.line(shapes.LINE_LOOP, shapes.circle(r, axes[j], axes[(j + 1) % 3], 72),
                             shapes.color(_SHELL, 0.8), 0.02 * r) for j in range(3)]
        return shapes.entity("shell", "ball", time_us, spheres=[shapes.sphere(r, shapes.color(_SHELL, 0.15))],
                             triangles=[shapes.triangles(points, indices, shapes.color(_SHELL, 0.25))], lines=rings)

    def _rails(self, time_us):
        return shapes.entity("rails", "ball", time_us, lines=[
            shapes.line(shapes.LINE_LOOP if rail.closed else shapes.LINE_STRIP, rail.points_B,
                        shapes.color(_MASS_COLORS[i % len(_MASS_COLORS)]), 0.02 * self._robot.radius)
            for i, rail in enumerate(self._robot.rails) if rail is not None and len(rail.points_B) > 1])

    def _masses(self, time_us):
        masses, r = self._robot.masses, self._robot.radius
        heaviest = max(masses, default=1.0)
        return [shapes.entity(f"mass_{i}", f"mass_{i}", time_us, spheres=[
            shapes.sphere(r * max(HEAVIEST_MASS * (mass / heaviest) ** (1 / 3), LEAST_MASS),
                          shapes.color(_MASS_COLORS[i % len(_MASS_COLORS)]))]) for i, mass in enumerate(masses)]

    def _force_color(self, sample):
        """Green while little of mu_s N is used, yellow at half of it, red where all is used or the ball slides."""
        rolls = sample.regime == ballast.contact_t.REGIME_ROLLING and math.isfinite(sample.margin)
        share = min(max(1 - sample.margin, 0.0), 1.0) if rolls else 1.0
        r, g, b = (float(np.interp(share, (0, 0.5, 1), column)) for column in _SHARE_COLORS.T)
        return {"r": round(r, 4), "g": round(g, 4), "b": round(b, 4), "a": 1.0}

    def _contact_scene(self, sample):
        robot, r, time_us = self._robot, self._robot.radius, sample.time_us
        tint = self._force_color(sample)
        along = WEIGHT_ARROW * r * sample.force_W / robot.weight_n
        length = float(np.linalg.norm(along))
        arrows, cones = [], []
        if sample.in_contact:
            if length > 1e-3 * r:
                arrows.append(shapes.arrow(along * min(1, LONGEST_ARROW * r / length), 0.05 * r, tint))
            mu = robot.static_friction_at(sample.position_W[:2])
            if math.isfinite(mu):
                height = CONE_SLANT * r / math.hypot(1, mu)
                cones.append(shapes.cylinder((0, 0, height / 2), mu * height, height, {**tint, "a": 0.25}, bottom_scale=0.0))
        note = shapes.text(_words(sample), (0, 0, 2.4 * r), 0.2 * r, shapes.color(_TEXT))
        return self._scene(
            shapes.entity("force", "contact", time_us, arrows=arrows),
            shapes.entity("cone", "contact", time_us, cylinders=cones),
            shapes.entity("numbers", "contact", time_us, texts=[note]),
            shapes.entity("center_of_mass", "ball", time_us, spheres=[
                shapes.sphere(0.04 * r, shapes.color("#000000"), sample.center_of_mass_B)]))

    def _floor_scene(self, time_us):
        path = shapes.entity("path", "floor", time_us, lines=[
            shapes.line(shapes.LINE_STRIP, points, shapes.color(_PATH_COLORS[regime]), 0.05 * self._robot.radius)
            for regime, points in self._path.stretches()])
        return self._scene(self._ground(time_us), path)

    def _ground(self, time_us):
        """A slab with a grid under path and plan. Its size goes in steps of the grid, which grows with them."""
        robot, r = self._robot, self._robot.radius
        depth = (len(robot.patches) + 1) * _LAYER * r
        places = [point[:2] for point in self._path.points]
        if robot.planned is not None:
            places += [robot.planned.goal, *robot.planned.path[:, 1:3]]
        low, high = np.min(places, axis=0) - 4 * r, np.max(places, axis=0) + 4 * r
        step = _round_length(max(float((high - low).max()) / 20, r / 2))
        first, last = np.floor(low / step).astype(int), np.ceil(high / step).astype(int)
        low, high = first * step, last * step
        lines = [((x * step, low[1], -depth), (x * step, high[1], -depth)) for x in range(first[0], last[0] + 1)]
        lines += [((low[0], y * step, -depth), (high[0], y * step, -depth)) for y in range(first[1], last[1] + 1)]
        slab = shapes.box([*low, -depth - 0.05 * r], [*high, -depth], shapes.color(_FLOOR))
        return shapes.entity("ground", "floor", time_us, cubes=[slab], lines=[shapes.line(
            shapes.LINE_LIST, [end for ends in lines for end in ends], shapes.color(_GRID), 1.0, in_pixels=True)])

    def _patches(self, time_us):
        """Later patches lie over earlier ones; the last lies just under the origin's height."""
        r, drawn = self._robot.radius, []
        for number, patch in enumerate(self._robot.patches):
            if patch.corners is None:
                flat = np.asarray(patch.center) + shapes.circle(patch.radius, (1, 0), (0, 1), 64)
            else:
                flat = patch.corners
            height = -(len(self._robot.patches) - number) * _LAYER * r
            points = np.column_stack([flat, np.full(len(flat), height)])
            drawn.append(shapes.triangles(points, shapes.triangulate(flat), shapes.color(KINDS[patch.kind][0])))
        return shapes.entity("patches", "floor", time_us, triangles=drawn)

    def _plan(self, time_us):
        planned, r = self._robot.planned, self._robot.radius
        if planned is None:
            return []
        tint = shapes.color(_PLAN)
        path = [(x, y, _LAYER * r) for x, y in planned.path[:, 1:3]]
        return [shapes.entity(
            "plan", "floor", time_us,
            lines=[shapes.line(shapes.LINE_STRIP, path, tint, 0.03 * r)] if len(path) > 1 else [],
            cylinders=[shapes.cylinder((*planned.goal, 0), 0.2 * r, 0.02 * r, tint),
                       *(shapes.cylinder((*place, 0), 0.1 * r, 0.02 * r, tint) for place, _ in planned.via)]),
            shapes.entity("keep_out", "floor", time_us, cylinders=[
                shapes.cylinder((*center, r), radius, 2 * r, shapes.color("#d55e00", 0.35))
                for center, radius in planned.keep_out])]
