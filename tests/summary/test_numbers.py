"""Numbers in what people read: at most four significant digits, no negative zero, no rounding shown as a number."""
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SHIPPED = sorted(path.stem for path in (ROOT / "sim/scenarios").glob("*.toml"))
BALLAST = os.environ["BALLAST"]

COMMANDS = [[command, name] for name in SHIPPED for command in ("check", "friction")]
COMMANDS += [["run", name] for name in SHIPPED]
COMMANDS += [
    ["run", "paper_ball", "--set", "surface.static_friction=0.17", "--out", "glass"],
    ["run", "paper_ball", "--set", "envelope.friction_use=0.5", "--out", "half"],
    ["run", "paper_ball", "--check-steps", "--set", "duration=2", "--out", "checked"],
    ["run", "desk_ball", "--fault", "motor_stall@2", "--out", "stall"],
    ["move", "paper_ball", "--mass", "1", "--to", "2.5"],
    ["move", "desk_ball", "--all", "0.3"],
    ["move", "desk_ball", "--mass", "1", "--to", "0.3", "--speed-fraction", "0.1"],
    ["integrate", "paper_ball"],
    ["integrate", "paper_ball", "--method", "rk4", "--step", "1"],
    ["new", "first", "--yes"],
    ["plan", "first.toml", "--time-limit", "1"],
    ["tune", "first_plan.toml"],
    ["run", "first_plan.toml"],
    ["compare", "runs/paper_ball", "half"],
    ["compare", "runs/paper_ball", "runs/paper_ball-move"],
]
# Distances between integrators are a result. Published values have the digits that were published, and values of two
# logs the digits that tell them apart.
EXEMPT = re.compile(r"^ +(dop853|rk4|published|BALLAST_).*|tolerance 1e-1\d|\S*/\S*", re.M)


def faults(text):
    """Every number that should not be there, with its line."""
    for line in EXEMPT.sub("", text).splitlines():
        for number in re.findall(r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?(?![\w.]*\d)", line):
            digits = re.sub(r"e.*|[-.]", "", number).lstrip("0")
            long = "." in number and len(digits) > 4
            if long or re.fullmatch(r"-0(\.0*)?", number) or re.search(r"e-1\d", number):
                yield f"{number} in: {line}"


class Numbers(unittest.TestCase):
    def test_are_short(self):
        with tempfile.TemporaryDirectory() as folder:
            for command in COMMANDS:
                done = subprocess.run([BALLAST, *command], cwd=folder, capture_output=True, text=True, check=False)
                with self.subTest(command=" ".join(command)):
                    self.assertIn(done.returncode, (0, 1, 3), done.stderr)
                    self.assertEqual(list(faults(done.stdout + done.stderr)), [])

    def test_faults_are_seen(self):
        for text in ("N 3.48032 N", "by -0.0", "at -0 m", "off by -4.44e-16 m", "0.00012345"):
            self.assertEqual(len(list(faults(text))), 1, text)
        for text in ("N 3.48 N", "10.52 s", "0.000123", "1522 + 1522 steps", "-0.01", "13300 times"):
            self.assertEqual(list(faults(text)), [], text)


if __name__ == "__main__":
    unittest.main()
