"""The arrows between rooms point down: each source includes only its own room and rooms below it.

ROOMS lists every room that holds C++, bottom first. A room may include only rooms listed before it; ALLOWED_EXTRA has the
exceptions. A new room has to be entered here, at the height where it belongs.
"""
import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]

ROOMS = [
    "firmware/model", "firmware/motion", "firmware/estimation", "firmware/tracking", "firmware/safety", "firmware/governor", "firmware/control",
    "hal", "hal/lockstep", "hal/lcm", "hal/target", "hal/mps2",
    "sim/integrators", "sim/motors", "sim/masses", "sim/plant", "sim/sensors", "sim/scenario", "sim/closed_forms",
    "tools/monitor", "tools/stepcheck", "tools/tracking", "tools/program", "tools/sil", "tools/faults", "tools/qemu", "tools/summary",
    "tools/recording", "tools/processes", "tools/integrators", "tools/plan", "tools/go", "tools/identify", "tools/soak", "tools/sweep", "tools/cluster", "tools/doctor", "tools/spy", "tools/watch", "tools/python",
    "tools/ballast", "tools/benchmarks", "tools/examples",
]
RAILS = {"firmware/model/rail.h", "firmware/model/types.h", "firmware/model/sin_cos.h"}
# tests/ holds data and adversaries that benchmarks share.
ALLOWED_EXTRA = {"tools/benchmarks": ("tests/data/", "tests/plan/", "tests/simbody/", "tests/target/")}


def room_of(path):
    return str(pathlib.PurePosixPath(path).parent)


def forbidden(room, included):
    """Why `room` may not include this file, or None."""
    if included.startswith("tests/"):
        return None if included.startswith(ALLOWED_EXTRA.get(room, ("\0",))) else "a test"
    target = room_of(included)
    if target == room or target not in ROOMS:
        return None  # lcmtypes and generated headers are below everything
    if ROOMS.index(target) > ROOMS.index(room):
        return f"{target} lies above {room}"
    top, target_top = room.split("/")[0], target.split("/")[0]
    if top == "firmware" and target_top != "firmware":
        return "firmware/ uses Eigen and itself only"
    if top == "sim" and target_top != "sim":
        if room == "sim/closed_forms" and target == "firmware/model":
            return None
        return None if included in RAILS else "sim/ uses the firmware's rails only"
    if room == "tools/monitor" and target_top in ("firmware", "sim"):
        return "the monitor shares limits with the firmware, never logic"
    return None


def breaches():
    for top in ("firmware", "hal", "sim", "tools"):
        for path in sorted((ROOT / top).rglob("*")):
            if path.suffix not in (".h", ".cpp"):
                continue
            name = path.relative_to(ROOT).as_posix()
            if room_of(name) not in ROOMS:
                yield f"{name}: its room is not in ROOMS"
                continue
            for included in re.findall(r'^\s*#include "([^"]+)"', path.read_text(), re.M):
                why = forbidden(room_of(name), included)
                if why:
                    yield f"{name} includes {included}: {why}"


class Arrows(unittest.TestCase):
    def test_all_point_down(self):
        self.assertEqual(list(breaches()), [])

    def test_a_breach_is_seen(self):
        self.assertIsNotNone(forbidden("firmware/control", "hal/board.h"))
        self.assertIsNotNone(forbidden("sim/plant", "firmware/model/rolling.h"))
        self.assertIsNotNone(forbidden("sim/plant", "sim/scenario/scenario.h"))
        self.assertIsNotNone(forbidden("tools/monitor", "tools/sil/lap.h"))
        self.assertIsNone(forbidden("tools/sil", "hal/lcm/bus.h"))


if __name__ == "__main__":
    unittest.main()
