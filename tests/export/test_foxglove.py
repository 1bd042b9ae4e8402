"""Frames and scenes of `ballast export --mcap`, read by Foxglove's @mcap/core and judged by Foxglove's own schemas.

Expected places come from the log by formulas of this file: rotation matrices, the rails as the scenario gives them, and
gravity's direction as in physics.md.
"""

import json
import math
import os
import random
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

import jsonschema
import numpy as np

import ballast
import foxglove_shapes as shapes
import npm_packages
import run_samples
from event_log import EventLog

BALLAST = os.environ["BALLAST"]
ANGLE, DOWNHILL, RADIUS = 0.2, 0.7, 0.15
MASS_RING = (np.array([0, -0.06, 0.0]), 0.095, np.array([0, 0, -1.0]), np.array([1.0, 0, 0]))  # center, radius, axes
MASS_LINE = (np.array([0.02, 0, -0.03]), np.array([0, 1.0, 0]))  # origin, direction
KINK = [[-2, -2], [2, -2], [2, 2], [0, 0.3], [-2, 2]]  # not convex
SCENARIO = f"""
name = "tilted"
duration = 1.5
gravity = 9.81
[ball]
radius = {RADIUS}
mass = 0.8
inertia = [0.0118, 0.0118, 0.0118]
center_of_mass = [0.003, -0.002, -0.01]
[surface]
static_friction = 0.6
slope = {{ angle = {ANGLE}, downhill = {DOWNHILL} }}
[[surface.patch]]
polygon = {KINK}
static_friction = 0.5
[[surface.patch]]
circle = {{ center = [0.3, 0.2], radius = 0.2 }}
static_friction = 0.4
[[mass]]
mass = 0.28
rail = {{ shape = "circle", radius = 0.095, center = [0, -0.06, 0], axes = [[0, 0, -1], [1, 0, 0]] }}
motion = [ {{ duration = 0.5, acceleration = [0.0, 1.5] }} ]
[[mass]]
mass = 0.3
rail = {{ shape = "line", origin = [0.02, 0, -0.03], direction = [0, 1, 0] }}
motion = [ {{ duration = 0.5, acceleration = [0.05, 0.05] }} ]
[initial]
orientation = [0.8, 0.0, 0.6, 0.0]
angular_velocity = [0.3, 1.0, -2.0]
[run]
actuation = "prescribed"
"""
TASK = """
[task]
goal = [1.0, 0.5]
via = [ { position = [0.5, 0.25] } ]
keep_out = [ { center = [0.4, 1.0], radius = 0.25 } ]
[plan]
path = [ [0.0, 0.0, 0.0, 0.1], [0.5, 0.4, 0.3, 0.1], [1.0, 1.0, 0.5, 0.1] ]
"""
# Tolerance on places and directions: the log has doubles, the frames all their digits, and each side rounds a few times.
ROUNDING = 1e-13
# Numbers of drawings have 8 digits, and the largest here are about 1 m.
DRAWN = 2e-8


def xyz(value):
    return np.array([value["x"], value["y"], value["z"]])


def matrix(w, x, y, z):
    """The rotation matrix of a unit quaternion."""
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def turn(value):
    return matrix(value["w"], value["x"], value["y"], value["z"])


class Frames:
    """The frames of one instant: where each lies in `world`."""

    def __init__(self, messages):
        self._by_child = {message["child_frame_id"]: message for message in messages}

    def __contains__(self, frame):
        return frame == "world" or frame in self._by_child

    def to_world(self, frame, point):
        while frame != "world":
            message = self._by_child[frame]
            point = turn(message["rotation"]) @ point + xyz(message["translation"])
            frame = message["parent_frame_id"]
        return point


class McapFile:
    """A file as @mcap/core reads it: `channels` by topic, and (topic, log time in ns, message) in order of time."""

    def __init__(self, packages, path):
        lines = npm_packages.output_of_node(packages, "read_mcap.mjs", path).splitlines()
        entries = [json.loads(line) for line in lines]
        self.channels = {entry["topic"]: entry for entry in entries if "schema" in entry}
        self.messages = [(entry["topic"], entry["logTime"], entry["message"]) for entry in entries if "message" in entry]
        assert all(entry["logTime"] == entry["publishTime"] for entry in entries if "message" in entry)

    def of(self, prefix):
        return [message for message in self.messages if message[0].startswith(prefix)]

    def at(self, time_ns):
        """The newest message of each topic at that time: what Foxglove takes when it seeks."""
        return {topic: message for topic, time, message in self.messages if time <= time_ns}


def entities(scene):
    return {entity["id"]: entity for entity in scene["entities"]}


class Foxglove(unittest.TestCase):
    """The run is made and exported once: the tests only read it."""

    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(holder.cleanup)
        cls.folder = Path(holder.name)
        cls.packages = cls.folder / "npm"
        npm_packages.unpack(cls.packages)
        cls.schemas = json.loads(npm_packages.output_of_node(cls.packages, "print_schemas.mjs"))
        cls.file = cls.run_and_export("tilted", SCENARIO, TASK)
        log = EventLog(cls.folder / "tilted" / "run.lcmlog", ["BALLAST_CONTACT", "BALLAST_PLANT_STATE"])
        cls.contact = log.messages("BALLAST_CONTACT", ballast.contact_t)
        cls.state = log.messages("BALLAST_PLANT_STATE", ballast.plant_state_t)
        cls.row = {int(time): row for row, time in enumerate(cls.state["utime"])}

    @classmethod
    def run_and_export(cls, name, scenario, appended=""):
        out = cls.folder / name
        if "\n" in scenario:
            (cls.folder / f"{name}.toml").write_text(scenario)
            scenario = cls.folder / f"{name}.toml"
        cls.ballast("run", scenario, "--quiet", "--out", out, status=None)
        with open(out / "scenario.toml", "a", encoding="utf-8") as file:
            file.write(appended)
        cls.ballast("export", out, "--mcap", cls.folder / f"{name}.mcap")
        return McapFile(cls.packages, cls.folder / f"{name}.mcap")

    @classmethod
    def ballast(cls, *arguments, status=0):
        done = subprocess.run([BALLAST, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)
        if status is not None and done.returncode != status:
            raise AssertionError(f"status {done.returncode}: {done.stdout}{done.stderr}")
        return done

    def samples(self):
        """(row of the log, newest messages by topic, frames) of each instant that is drawn."""
        for time in sorted({time for topic, time, _ in self.file.messages if topic == "/frames/ball"}):
            newest = self.file.at(time)
            frames = Frames([message for topic, message in newest.items() if topic.startswith("/frames/")])
            yield self.row[time // 1000], newest, frames

    def test_channels_have_foxgloves_schemas(self):
        def bare(value):
            if isinstance(value, list):
                return [bare(entry) for entry in value]
            if not isinstance(value, dict):
                return value
            return {key: bare(entry) for key, entry in value.items()
                    if key != "$comment" and not (key == "description" and isinstance(entry, str))}

        drawn = {topic: channel for topic, channel in self.file.channels.items() if topic.startswith("/")}
        frames = {f"/frames/{name}" for name in ("floor", "space", "contact", "ball", "mass_0", "mass_1")}
        self.assertEqual(set(drawn), frames | {"/scene/fixed", "/scene/contact", "/scene/floor"})
        for topic, channel in drawn.items():
            name = "foxglove.FrameTransform" if topic in frames else "foxglove.SceneUpdate"
            self.assertEqual((channel["messageEncoding"], channel["encoding"], channel["name"]), ("json", "jsonschema", name))
            self.assertEqual(json.loads(channel["schema"]), bare(self.schemas[name]))

    def test_messages_are_valid_by_foxgloves_schemas(self):
        for topic, channel in self.file.channels.items():
            if not topic.startswith("/"):
                continue
            validator = jsonschema.Draft7Validator(self.schemas[channel["name"]])
            messages = [message for other, _, message in self.file.messages if other == topic]
            for message in messages[:: max(1, len(messages) // 20)]:
                validator.validate(message)
            with self.assertRaises(jsonschema.ValidationError):
                validator.validate({key: value for key, value in messages[0].items() if key not in ("entities", "rotation")})

    def test_times_are_simulated_and_go_up(self):
        seen = {}
        for topic, time, message in self.file.of("/"):
            self.assertGreater(time, seen.get(topic, -1))
            seen[topic] = time
            for stamp in [message["timestamp"]] if "timestamp" in message else [e["timestamp"] for e in message["entities"]]:
                self.assertEqual(stamp["sec"] * 10**9 + stamp["nsec"], time)
        balls = [time for topic, time, _ in self.file.messages if topic == "/frames/ball"]
        self.assertEqual(balls[-1] // 1000, self.state["utime"][-1], "the run's last sample is drawn")
        np.testing.assert_array_equal(np.diff(balls), 10**7)

    def test_the_floor_slopes_as_gravity_says(self):
        message = self.file.at(0)["/frames/floor"]
        self.assertEqual((message["parent_frame_id"], message["child_frame_id"]), ("world", "floor"))
        to_world = turn(message["rotation"])
        np.testing.assert_allclose(to_world @ to_world.T, np.eye(3), atol=ROUNDING)
        gravity = [math.sin(ANGLE) * math.cos(DOWNHILL), math.sin(ANGLE) * math.sin(DOWNHILL), -math.cos(ANGLE)]
        np.testing.assert_allclose(to_world @ gravity, [0, 0, -1], atol=ROUNDING)
        # The direction of steepest descent keeps its heading and goes down by the angle.
        descent = to_world @ [math.cos(DOWNHILL), math.sin(DOWNHILL), 0]
        expected = [math.cos(ANGLE) * math.cos(DOWNHILL), math.cos(ANGLE) * math.sin(DOWNHILL), -math.sin(ANGLE)]
        np.testing.assert_allclose(descent, expected, atol=ROUNDING)

    def test_masses_are_where_the_rails_have_them(self):
        floor = turn(self.file.at(0)["/frames/floor"]["rotation"])
        for row, newest, frames in self.samples():
            state = self.state[row]
            center, radius, first, second = MASS_RING
            theta = state["mass_position"]
            zeta = [center + radius * (math.cos(theta[0]) * first + math.sin(theta[0]) * second),
                    MASS_LINE[0] + theta[1] * MASS_LINE[1]]
            middle = np.array(state["position_W_m"]) + [0, 0, RADIUS]
            for i in range(2):
                expected = floor @ (middle + matrix(*state["orientation"]) @ zeta[i])
                np.testing.assert_allclose(frames.to_world(f"mass_{i}", np.zeros(3)), expected, atol=ROUNDING)
            np.testing.assert_allclose(frames.to_world("ball", np.zeros(3)), floor @ middle, atol=ROUNDING)
            foot = floor @ (middle - [0, 0, RADIUS])
            np.testing.assert_allclose(frames.to_world("contact", np.zeros(3)), foot, atol=ROUNDING)

    def test_the_ball_rolls(self):
        """The material point at the contact rests: in 10 ms it moves by the acceleration only, not by the velocity."""
        samples = list(self.samples())
        travelled = 0
        for (row, _, frames), (_, _, later) in zip(samples, samples[1:]):
            state = self.state[row]
            foot_B = matrix(*state["orientation"]).T @ [0, 0, -RADIUS]
            moved = np.linalg.norm(later.to_world("ball", foot_B) - frames.to_world("ball", foot_B))
            # The point's acceleration is |Omega|^2 r; half of it times dt^2, and as much again for its change in dt.
            rate = np.linalg.norm(state["angular_velocity_B_radps"]) + 0.5
            self.assertLess(moved, rate**2 * RADIUS * 0.01**2)
            travelled += np.linalg.norm(state["velocity_W_mps"]) * 0.01
        self.assertGreater(travelled, 5 * RADIUS, "it went far enough that a ball that slides would be noticed")

    def test_the_force_points_from_the_contact_and_shows_how_near_the_cone_is(self):
        weight = 9.81 * (0.8 + 0.28 + 0.3)
        reds, limits = [], set()
        for row, newest, _ in self.samples():
            contact = self.contact[row]
            drawn = entities(newest["/scene/contact"])
            (arrow,), (cone,) = drawn["force"]["arrows"], drawn["cone"]["cylinders"]
            force = np.array([*contact["friction_force_W_n"], contact["normal_force_n"]])
            along = turn(arrow["pose"]["orientation"]) @ [1, 0, 0]
            np.testing.assert_allclose(along, force / np.linalg.norm(force), atol=ROUNDING)
            np.testing.assert_array_equal(xyz(arrow["pose"]["position"]), 0)
            length = arrow["shaft_length"] + arrow["head_length"]
            self.assertAlmostEqual(length, min(1.15 * np.linalg.norm(force) / weight, 2.6) * RADIUS, delta=ROUNDING)
            size, middle = xyz(cone["size"]), xyz(cone["pose"]["position"])
            # By margin = 1 - f_s / (mu_s N). Where little is used, 1 - margin has few digits.
            mu = contact["static_friction_n"] / contact["normal_force_n"] / (1 - contact["margin"])
            self.assertGreater(1 - contact["margin"], 1e-3)
            self.assertAlmostEqual(size[0] / 2 / size[2], mu, delta=1e-7)
            limits.add(round(float(mu), 6))
            self.assertEqual((cone["bottom_scale"], cone["top_scale"]), (0, 1))
            self.assertAlmostEqual(middle[2], size[2] / 2, delta=DRAWN)
            reds.append((float(contact["margin"]), arrow["color"]["r"] - arrow["color"]["g"]))
        self.assertGreater(len(limits), 1, "the ball comes onto another patch")
        reds.sort(reverse=True)
        self.assertTrue(all(a[1] <= b[1] + 1e-4 for a, b in zip(reds, reds[1:])), "less margin is redder")
        self.assertGreater(reds[-1][1] - reds[0][1], 0.1)

    def test_entities_lie_in_known_frames_and_stay(self):
        for _, newest, frames in self.samples():
            for scene in ("/scene/fixed", "/scene/contact", "/scene/floor"):
                self.assertEqual(newest[scene]["deletions"], [])
                found = newest[scene]["entities"]
                self.assertEqual(len({entity["id"] for entity in found}), len(found))
                for entity in found:
                    self.assertIn(entity["frame_id"], frames)
                    self.assertEqual((entity["lifetime"], entity["frame_locked"]), ({"sec": 0, "nsec": 0}, True))

    def test_shell_rails_and_masses(self):
        drawn = entities(self.file.at(0)["/scene/fixed"])
        shell = drawn["shell"]
        self.assertEqual(shell["frame_id"], "ball")
        np.testing.assert_allclose(xyz(shell["spheres"][0]["size"]), 2 * RADIUS, atol=DRAWN)
        self.assertLess(shell["spheres"][0]["color"]["a"], 0.5)
        points = [xyz(p) for part in (*shell["lines"], *shell["triangles"]) for p in part["points"]]
        np.testing.assert_allclose(np.linalg.norm(points, axis=1), RADIUS, atol=DRAWN)
        ring, straight = drawn["rails"]["lines"]
        center, radius, first, second = MASS_RING
        off = [xyz(p) - center for p in ring["points"]]
        np.testing.assert_allclose([math.hypot(p @ first, p @ second) for p in off], radius, atol=DRAWN)
        np.testing.assert_allclose([p @ [0, 1, 0] for p in off], 0, atol=DRAWN)
        ends = [xyz(p) for p in straight["points"]]
        np.testing.assert_allclose(np.linalg.norm(ends, axis=1), RADIUS, atol=DRAWN)
        np.testing.assert_allclose([p[[0, 2]] for p in ends], [[0.02, -0.03]] * len(ends), atol=DRAWN)
        sizes = [xyz(drawn[f"mass_{i}"]["spheres"][0]["size"])[0] for i in range(2)]
        self.assertAlmostEqual((sizes[0] / sizes[1]) ** 3, 0.28 / 0.3, delta=1e-6)

    def test_patches_cover_their_places(self):
        drawn = entities(self.file.at(0)["/scene/fixed"])["patches"]
        self.assertEqual(drawn["frame_id"], "floor")
        polygon, disc = drawn["triangles"]
        x, y = np.array(KINK).T
        shoelace = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
        self.assertAlmostEqual(self.area(polygon), shoelace, delta=1e-6)
        self.assertAlmostEqual(self.area(disc), 32 * math.sin(math.pi / 32) * 0.2**2, delta=1e-6)  # of a 64-gon
        heights = [xyz(part["points"][0])[2] for part in (polygon, disc)]
        self.assertLess(heights[0], heights[1])
        self.assertLess(heights[1], 0)

    def area(self, part):
        points = np.array([xyz(p) for p in part["points"]])
        corners = points[np.array(part["indices"]).reshape(-1, 3)]
        crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]
        self.assertTrue((crossed > 0).all(), "triangles face up and are not empty")
        return crossed.sum() / 2

    def test_path_floor_and_plan(self):
        newest = self.file.at(10**10)
        (path,) = entities(newest["/scene/floor"])["path"]["lines"]
        points = np.array([xyz(p) for p in path["points"]])
        np.testing.assert_allclose(points[-1][:2], self.state["position_W_m"][-1][:2], atol=DRAWN)
        every = np.array(self.state["position_W_m"])[:, :2]
        off = [np.linalg.norm(every - p[:2], axis=1).min() for p in points]
        self.assertLess(max(off), DRAWN)
        self.assertLess(np.linalg.norm(np.diff(points, axis=0), axis=1).max(), 0.2 * RADIUS)
        (slab,) = entities(newest["/scene/floor"])["ground"]["cubes"]
        low, high = (xyz(slab["pose"]["position"]) + sign * xyz(slab["size"]) / 2 for sign in (-1, 1))
        self.assertTrue((low[:2] < points[:, :2].min(axis=0)).all() and (high[:2] > points[:, :2].max(axis=0)).all())
        self.assertTrue(-0.02 * RADIUS < high[2] < 0)
        drawn = entities(newest["/scene/fixed"])
        plan = drawn["plan"]
        places = np.array([xyz(p)[:2] for p in plan["lines"][0]["points"]])
        np.testing.assert_allclose(places, [[0, 0], [0.4, 0.3], [1, 0.5]], atol=DRAWN)
        marks = [xyz(mark["pose"]["position"])[:2] for mark in plan["cylinders"]]
        np.testing.assert_allclose(marks, [[1.0, 0.5], [0.5, 0.25]], atol=DRAWN)
        (obstacle,) = drawn["keep_out"]["cylinders"]
        np.testing.assert_allclose([*xyz(obstacle["pose"]["position"])[:2], xyz(obstacle["size"])[0]], [0.4, 1.0, 0.5])

    def test_the_layout_shows_what_is_there(self):
        layout = json.loads((Path(__file__).resolve().parents[2] / "tools/export/foxglove_layout.json").read_text())
        panels = layout["configById"]
        scene = panels["3D!ballast"]
        self.assertEqual({topic for topic in self.file.channels if topic.startswith("/scene/")}, set(scene["topics"]))
        self.assertIn(f"/frames/{scene['followTf']}", self.file.channels)
        for path in (path for name, panel in panels.items() if name.startswith("Plot!") for path in panel["paths"]):
            topic, field = path["value"].split(".")
            self.assertIn(field, json.loads(self.file.channels[topic]["schema"])["properties"])

        def names(part):
            return [part] if isinstance(part, str) else names(part["first"]) + names(part["second"])

        self.assertEqual(sorted(names(layout["layout"])), sorted(panels))

    def test_a_hop_leaves_the_floor_and_has_no_force(self):
        file = self.run_and_export("hop", "hop")
        log = EventLog(self.folder / "hop" / "run.lcmlog", ["BALLAST_CONTACT"])
        regime = {int(row["utime"]) * 1000: int(row["regime"]) for row in log.messages("BALLAST_CONTACT", ballast.contact_t)}
        flying = 0
        for topic, time, message in file.of("/scene/contact"):
            drawn, flies = entities(message), regime[time] == ballast.contact_t.REGIME_FLIGHT
            self.assertEqual(len(drawn["force"]["arrows"]), 0 if flies else 1)
            self.assertEqual(len(drawn["cone"]["cylinders"]), 0 if flies else 1)
            if flies and regime.get(time - 10**6) == regime[time]:
                height = file.at(time)["/frames/ball"]["translation"]["z"]
                self.assertGreater(height, 0)
                flying += 1
        self.assertGreater(flying, 5)
        lines = entities(file.at(10**11)["/scene/floor"])["path"]["lines"]
        self.assertGreater(len({json.dumps(line["color"]) for line in lines}), 1)

    def test_the_masses_of_a_disk_stay_in_its_plane(self):
        self.ballast("run", "paper_disk", "--actuation", "prescribed", "--set", "duration=2", "--quiet", "--out",
                     self.folder / "disk")
        self.ballast("export", self.folder / "disk", "--mcap", self.folder / "disk.mcap")
        file = McapFile(self.packages, self.folder / "disk.mcap")
        for time in range(0, 2 * 10**9 + 1, 10**8):
            frames = Frames([message for topic, message in file.at(time).items() if topic.startswith("/frames/")])
            for i, radius in enumerate((0.9, 0.6333333333333333, 0.36666666666666664, 0.1)):
                mass, middle = (frames.to_world(frame, np.zeros(3)) for frame in (f"mass_{i}", "ball"))
                self.assertAlmostEqual(mass[1], 0, delta=1e-9)  # the integration's own tolerance
                self.assertAlmostEqual(np.linalg.norm(mass - middle), radius, delta=1e-12)

    def test_what_cannot_be_drawn_is_said_and_the_channels_stay(self):
        def without(name):
            (out / name).unlink()

        def robot(change):
            described = json.loads((out / "robot.json").read_text())
            change(described)
            (out / "robot.json").write_text(json.dumps(described))

        for spoil, words in (
                (lambda: without("robot.json"), "robot.json: No such file"),
                (lambda: without("scenario.toml"), "scenario.toml: No such file"),
                (lambda: (out / "robot.json").write_text("{"), "robot.json: not what a run writes"),
                (lambda: (out / "scenario.toml").write_text("surface = 3"), "scenario.toml: not what a run writes"),
                (lambda: robot(lambda d: d["ball"].update(radius=-1)), "a number is out of range"),
                (lambda: robot(lambda d: d["masses"].pop()), "of another robot: the log has 2 masses")):
            out = self.folder / "spoilt"
            shutil.rmtree(out, ignore_errors=True)
            shutil.copytree(self.folder / "tilted", out)
            spoil()
            with self.subTest(words):
                done = self.ballast("export", out, "--mcap", self.folder / "spoilt.mcap")
                self.assertIn("run.lcmlog: frames and scenes: nothing drawn: ", done.stderr)
                self.assertIn(words, done.stderr)
                self.assertRegex(done.stdout, r"^\d channels in ")
                file = McapFile(self.packages, self.folder / "spoilt.mcap")
                self.assertEqual(file.of("/"), [])
                self.assertEqual({topic for topic, *_ in file.messages}, set(file.channels))


class Samples(unittest.TestCase):
    """Which messages are drawn."""

    def messages(self, tick, **changed):
        """The two messages of a tick, at 1 ms per tick, in the order of a run."""
        contact, state = ballast.contact_t(), ballast.plant_state_t()
        contact.tick = state.tick = tick
        state.orientation, state.mass_count = [1.0, 0, 0, 0], 2
        for name, value in changed.items():
            setattr(contact if hasattr(contact, name) else state, name, value)
        return [(1000 * max(tick, 0), run_samples.CONTACT, contact.encode()),
                (1000 * max(tick, 0), run_samples.STATE, state.encode())]

    def ticks(self, samples, messages):
        return [taken[0].tick for taken in (samples.take(*message) for message in messages) if taken]

    def test_every_tenth_millisecond_and_the_last(self):
        run = [message for tick in range(-3, 34) for message in self.messages(tick)] + self.messages(34, last=1)
        self.assertEqual(self.ticks(run_samples.RunSamples(), run), [0, 10, 20, 30, 34])
        # The order of the two messages of a tick does not matter, and half of one is none.
        swapped = [message for tick in range(0, 25) for message in reversed(self.messages(tick)) if tick != 10]
        swapped.insert(20, self.messages(10)[0])
        self.assertEqual(self.ticks(run_samples.RunSamples(), swapped), [0, 11, 20])

    def test_a_second_run_begins_anew(self):
        run = [message for tick in range(0, 25) for message in self.messages(tick)]
        self.assertEqual(self.ticks(run_samples.RunSamples(), run + run), [0, 10, 20, 0, 10, 20])

    def test_what_has_no_place_is_counted(self):
        for changed in ({"position_W_m": [math.nan, 0, 0]}, {"orientation": [0.9, 0, 0, 0]}, {"mass_count": 9},
                        {"mass_count": -1}, {"regime": 7}, {"normal_force_n": math.inf},
                        {"mass_position_B_m": [[0, math.inf, 0]] + [[0, 0, 0]] * 7}):
            samples = run_samples.RunSamples()
            self.assertEqual(self.ticks(samples, self.messages(0, **changed) + self.messages(10)), [10], changed)
            self.assertEqual(samples.skipped, 1)
        samples = run_samples.RunSamples()
        strangers = [(0, channel, payload[:-1]) for _, channel, payload in self.messages(0)]
        self.assertEqual(self.ticks(samples, strangers + [(0, run_samples.STATE, b"x" * 700), (0, "OTHER", b"")]), [])


class Shapes(unittest.TestCase):
    def test_polygons_are_cut_into_triangles(self):
        seed = random.randrange(2**32)
        draw = random.Random(seed)
        for _ in range(200):
            count = draw.randint(3, 64)
            angles = sorted(draw.uniform(0, 2 * math.pi) for _ in range(count))
            if max(b - a for a, b in zip(angles, [*angles[1:], angles[0] + 2 * math.pi])) >= math.pi:
                continue  # the border of a star goes once round its centre
            corners = np.array([draw.uniform(0.2, 1) * np.array([math.cos(a), math.sin(a)]) for a in angles])
            if draw.random() < 0.5:
                corners = corners[::-1]
            x, y = corners.T
            area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
            cut = corners[np.array(shapes.triangulate(corners)).reshape(-1, 3)]
            self.assertEqual(len(cut), count - 2)
            (ax, ay), (bx, by) = (cut[:, 1] - cut[:, 0]).T, (cut[:, 2] - cut[:, 0]).T
            parts = (ax * by - ay * bx) / 2
            # Triangles of the right orientation whose areas add up neither overlap nor leave a hole. Rounding is of 1e-16.
            self.assertGreater(parts.min(), -1e-14, f"seed {seed}")
            self.assertAlmostEqual(parts.sum(), area, delta=1e-13, msg=f"seed {seed}")

    def test_arrows_turn_to_any_direction(self):
        seed = random.randrange(2**32)
        draw = random.Random(seed)
        directions = [np.array([draw.gauss(0, 1) for _ in range(3)]) for _ in range(100)]
        for direction in [*directions, np.array([-1.0, 0, 0]), np.array([1.0, 0, 0]), np.array([-1, 1e-9, 0])]:
            direction = direction / np.linalg.norm(direction)
            rotation = matrix(*shapes.turn_of_x_to(direction))
            # Near -x the turn has the cancellation of 1 + x in it: 1e-9 of the direction is lost at most.
            np.testing.assert_allclose(rotation @ [1, 0, 0], direction, atol=2e-9, err_msg=f"seed {seed}")
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12, err_msg=f"seed {seed}")


if __name__ == "__main__":
    unittest.main()
