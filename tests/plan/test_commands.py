"""The commands that a builder of a first robot uses, as the pages say: every command of the pages is executed."""

import json
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

DOCS = pathlib.Path(__file__).resolve().parents[2] / "tools/docs"
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def shape(line):
    """A line without its numbers and the width of its blanks. Machines and later versions give other digits."""
    return re.sub(r"\s+", " ", NUMBER.sub("#", line)).strip()


def blocks(page):
    return re.findall(r"^```console\n(.*?)^```", page, re.M | re.S)


def commands(page):
    """(command, lines of output that the page shows) of each block of a page."""
    for block in blocks(page):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            command, *shown = part.rstrip("\n").split("\n")
            yield command, [line for line in shown if line.strip() not in ("", "...")]


class Commands(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def ballast(self, line, status=0):
        done = subprocess.run(f"{os.environ['BALLAST']} {line}", shell=True, cwd=self.folder, capture_output=True,
                              text=True, check=False)
        if status is not None:
            self.assertEqual(done.returncode, status, f"ballast {line}\n{done.stdout}{done.stderr}")
        return done.stdout.replace(os.environ["BALLAST"], "ballast"), done.stderr

    def first(self, change=lambda text: text):
        self.ballast("new first --yes")
        path = self.folder / "first.toml"
        path.write_text(change(path.read_text()))

    def assert_page(self, name):
        for command, shown in commands((DOCS / name).read_text()):
            with self.subTest(command):
                self.assertTrue(command.startswith("ballast "), command)
                said = [shape(line) for line in self.ballast(command.removeprefix("ballast "))[0].splitlines()]
                at = 0
                for line in shown:
                    self.assertIn(shape(line), said[at:], f"{line}\n\nis not, in this order, in\n\n" + "\n".join(said))
                    at = said.index(shape(line), at) + 1

    def test_your_first_robot_rolls_as_its_page_says(self):
        self.assert_page("first_robot.md")
        run = self.folder / "runs/first_plan"
        for name in ("plan_path.png", "plan_need.png", "report.html"):
            self.assertTrue((run / name).exists(), name)
        self.assertIn('id="plan-map"', (run / "report.html").read_text())
        summary = json.loads((run / "summary.json").read_text())
        self.assertEqual(summary["end"]["reason"], "completed")
        self.assertIsNone(summary["trip"])
        # Without feedback motors and floor leave a millimetre or so.
        x, y, _ = summary["final"]["position"]
        self.assertLess(abs(x - 0.5) + abs(y), 0.005)

    def test_a_time_limit_that_has_passed_leaves_nothing_to_do(self):
        self.first()
        error = self.ballast("plan first.toml --time-limit 1e-9", status=3)[1]
        self.assertIn("the search was ended before it had found one", error)
        self.assertEqual(json.loads((self.folder / "first_plan.json").read_text())["iterations"], 0)
        self.assertIn("no chart", self.ballast("plan first.toml --chart --time-limit 1e-9", status=3)[1])

    def test_tune_does_as_its_page_says(self):
        self.assert_page("tune.md")

    def test_robots_of_all_sizes_plan_and_run(self):
        """Answers of `ballast new`: radius, shell, masses, friction, distance."""
        for answers in ((0.08, 0.2, 0.06, 0.5, 0.3), (0.1, 0.4, 0.12, 0.5, 0.4), (0.3, 3, 1.2, 0.6, 1.0)):
            with self.subTest(answers):
                name = f"robot{answers[0]}".replace(".", "_")
                typed = "".join(f"{answer}\\n" for answer in answers)
                done = subprocess.run(f"printf '{typed}' | {os.environ['BALLAST']} new {name}", shell=True,
                                      cwd=self.folder, capture_output=True, text=True, check=False)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.ballast(f"plan {name}.toml --quiet")
                self.assertIn(": good. ", self.ballast(f"check {name}_plan.toml")[0])
                self.ballast(f"run {name}_plan.toml --quiet --no-log")

    def test_says_where_its_motors_do_not_get_there(self):
        self.first(lambda text: text.replace("static_friction = 0.5", "static_friction = 0.15"))
        said, _ = self.ballast("plan first.toml")
        self.assertIn("with its steppers it does not get there: the controller refuses the start: no stop can be certified", said)
        self.assertNotIn("with its steppers it needs", said)
        self.assertIsNone(json.loads((self.folder / "first_plan.json").read_text())["stepper_mu_required"])
        # The motors of a small ball shake it more than the governor allows.
        subprocess.run(f"printf '0.1\\n\\n\\n\\n\\n' | {os.environ['BALLAST']} new small", shell=True, cwd=self.folder, check=True,
                       capture_output=True)
        said, _ = self.ballast("plan small.toml")
        self.assertRegex(said, r"does not get there: the ball ends \d{3} mm from there; the governor bends \d+(\.\d)? % of the commands")

    def test_chart_writes_table_and_picture(self):
        self.first(lambda text: text.replace('actuation = "stepper"', 'actuation = "prescribed"'))
        said, _ = self.ballast("plan --chart first.toml --out out.json")
        chart = json.loads((self.folder / "out.json").read_text())
        self.assertGreater(len([point for point in chart["points"] if point["mu_required"]]), 8)
        self.assertTrue((self.folder / "out.csv").read_text().startswith("duration_s,mu_required,"))
        self.assertEqual((self.folder / "out.png").read_bytes()[:4], b"\x89PNG")
        self.assertIn("the shortest time over the floor", said)

    def test_chart_refuses_what_it_cannot_do(self):
        self.first()
        _, why = self.ballast("plan --chart first.toml --from first.toml", 1)
        self.assertIn("--from", why)
        _, why = self.ballast("plan --chart first.toml --out chart.png", 1)
        self.assertIn(".json", why)
        self.ballast("plan --chart none.toml", 1)
        self.assertEqual([path.name for path in self.folder.iterdir()], ["first.toml"])

    def test_a_plan_replaces_only_plans(self):
        self.first()
        own = (self.folder / "first.toml").read_text()
        (self.folder / "mine.toml").write_text(own)
        os.mkfifo(self.folder / "pipe.toml")
        (self.folder / "first_plan.json").mkdir()
        for out, why in (("--out mine.toml", "is no plan"), ("--out pipe.toml", "is a device"), ("", "is a folder")):
            with self.subTest(out):
                self.assertIn(why, self.ballast(f"plan first.toml {out}", 1)[1])
        self.assertEqual((self.folder / "mine.toml").read_text(), own)
        self.assertTrue((self.folder / "pipe.toml").is_fifo())
        self.assertIn("is a device", self.ballast("tune desk_ball --out pipe.toml", 1)[1])
        (self.folder / "first_plan.json").rmdir()
        self.ballast("plan first.toml --quiet")
        self.ballast("plan first.toml --quiet")
        said, _ = self.ballast("run first_plan.toml --set surface.rolling_resistance=5 --set control.governor=false --no-log", None)
        self.assertRegex(said, r"goal +\(0.5, 0\) m in its plan; the ball ended \d{3} mm from there")

    def test_gains_fit_the_link_and_refuse_what_has_no_motion(self):
        said, _ = self.ballast("plan --gains desk_ball --out gains.csv")
        rows = (self.folder / "gains.csv").read_text().splitlines()
        self.assertEqual(len(rows[0].split(",")), 1 + 9 + 3 * 14)
        self.assertIn(f"at {len(rows) - 1} times", said)
        self.assertLessEqual((len(rows) - 1) * (9 + 3 * 14) * 4, 32768)
        self.first()
        for line in ("first.toml", "none.toml", "desk_ball --chart", "desk_ball --from first.toml",
                     "desk_ball --out first.toml/gains.csv"):
            with self.subTest(line):
                status = 2 if "first.toml/" in line else 1
                _, why = self.ballast(f"plan --gains {line}", status)
                self.assertTrue(why.strip())
        _, why = self.ballast("plan --gains first.toml --out first.toml", 1)
        self.assertIn("--out", why)

    def test_tune_refuses_what_has_no_motors_or_motion(self):
        self.first()
        _, why = self.ballast("tune first.toml", 1)
        self.assertIn("ballast plan first.toml", why.replace(os.environ["BALLAST"], "ballast"))
        self.ballast("tune none.toml", 1)
        _, why = self.ballast("tune desk_ball --actuation prescribed", 1)
        self.assertIn("--actuation stepper", why)
        _, why = self.ballast("tune desk_ball --fault motor_stall@2", 1)
        self.assertIn("faults", why)

    def test_tune_ends_with_3_where_the_floor_does_not_hold(self):
        said, _ = self.ballast("tune desk_ball --set surface.static_friction=0.1 --out tune.json", 3)
        self.assertIn("does NOT hold", said)
        found = json.loads((self.folder / "tune.json").read_text())
        self.assertFalse(found["holds"])
        self.assertGreater(found["now"]["mu_required"]["max"], 0.1)
        ladder = [row for row in found["microsteps"] if row["figures"]]
        self.assertGreater(len(ladder), 3)
        # A run with the change needs the friction that tune says.
        change = next(row for row in found["changes"] if row["change"] == "half the detent torque")
        sets = " ".join(f"--set {item}" for item in change["set"])
        self.ballast(f"run desk_ball --quiet --no-log --set surface.static_friction=1 {sets} --out again")
        summary = json.loads((self.folder / "again/summary.json").read_text())
        # Another floor ends no run here, so the same motion needs the same friction.
        self.assertAlmostEqual(summary["mu_required"]["max"], change["figures"]["mu_required"]["max"], delta=1e-9)


if __name__ == "__main__":
    unittest.main()
