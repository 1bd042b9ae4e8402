"""ballast identify as a person types it: its texts, its file, and runs that it cannot use."""
import os
import pathlib
import subprocess
import tempfile
import tomllib
import unittest

BALLAST = os.environ["BALLAST"]


def ballast(*words, cwd):
    return subprocess.run([BALLAST, *words], capture_output=True, text=True, cwd=cwd)


class Command(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.cwd = pathlib.Path(cls.folder.name)
        # Ideal masses and a short hold make the run cheap.
        run = ballast("run", "desk_ball", "--actuation", "ideal", "--set", "sensors.preset=bmi088_calibrated", "--set", "run.hold=1",
                      "--set", "duration=5", "--set", "believed.ball.mass=0.84", "--quiet", "--out", "run", cwd=cls.cwd)
        assert run.returncode == 0, run.stderr

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def refused(self, status, text, *words):
        done = ballast("identify", *words, cwd=self.cwd)
        self.assertEqual(done.returncode, status, done.stderr)
        self.assertIn(text, done.stderr)

    def test_fits_and_writes_a_belief(self):
        done = ballast("identify", "run", "--write", "known.toml", cwd=self.cwd)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("that of the scenario: motion does not show it", done.stdout)
        self.assertRegex(done.stdout, r"mass\.0\.mass +0\.28 ")
        self.assertIn("known.toml: the scenario with what was identified as [believed]", done.stdout)
        self.assertIn("declared    control.belief_error.mass stays as it was: ball.inertia.0 is unknown\n", done.stdout)
        checked = ballast("check", "known.toml", cwd=self.cwd)
        self.assertEqual(checked.returncode, 0, checked.stderr)

    def test_refuses_a_run_twice_and_options_of_excite_without_it(self):
        self.refused(1, "run: is given twice", "run", "run")
        self.refused(1, "--candidates requires --excite", "run", "--candidates", "3")

    def test_writes_a_belief_into_another_scenario(self):
        done = ballast("identify", "run", "--into", "desk_ball", "--write", "known_desk.toml", cwd=self.cwd)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("known_desk.toml: desk_ball with what was identified as [believed]", done.stdout)
        done = ballast("identify", "run", "--write", "known_run.toml", cwd=self.cwd)
        self.assertEqual(done.returncode, 0, done.stderr)
        written, of_run = (tomllib.loads((self.cwd / name).read_text()) for name in ("known_desk.toml", "known_run.toml"))
        self.assertEqual((written["name"], of_run["name"]), ("known_desk", "known_run"))
        self.assertNotIn("sensors", written)  # those of the run
        self.assertEqual(written["believed"]["mass"], of_run["believed"]["mass"])
        self.assertEqual(written["believed"]["ball"]["inertia"][0], written["ball"]["inertia"][0])  # unknown
        self.refused(1, "--into: run and paper_ball are of different robots: radius 0.15 and 1 m", "run", "--into",
                     "paper_ball", "--write", "no.toml")
        self.refused(1, "--into: is written with what was identified", "run", "--into", "desk_ball")
        self.refused(1, "--into: is written with what was identified", "--excite", "desk_ball", "--into", "desk_ball")
        self.assertFalse((self.cwd / "no.toml").exists())

    def test_says_how_short_a_motion_may_be(self):
        self.refused(3, "no motion is proposed: 1 s of the run can be used", "--excite", "desk_ball", "--set",
                     "sensors.preset=bmi088_calibrated", "--duration", "1", "--candidates", "2", "--write", "no.toml")

    def test_uses_a_damaged_log_up_to_the_damage(self):
        cut = self.cwd / "cut"
        cut.mkdir()
        (cut / "scenario.toml").write_bytes((self.cwd / "run/scenario.toml").read_bytes())
        log = (self.cwd / "run/run.lcmlog").read_bytes()
        (cut / "run.lcmlog").write_bytes(log[:len(log) * 9 // 10 + 7])
        done = ballast("identify", "cut", cwd=self.cwd)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("up to where the log is", done.stdout)

    def test_says_what_it_cannot_use(self):
        self.refused(1, "no folder of a run", "nowhere")
        self.refused(1, "RUN and --excite", "run", "--excite", "desk_ball")
        self.refused(1, "RUN and --excite")
        self.refused(1, "--set: only with --excite", "run", "--set", "seed=1")
        self.refused(1, "sensors: there is no IMU", "--excite", "desk_ball")

    def test_says_that_robots_differ(self):
        other = ballast("run", "desk_ball", "--actuation", "ideal", "--set", "sensors.preset=bmi088_calibrated", "--set", "run.hold=1",
                        "--set", "duration=1", "--quiet", "--out", "other", cwd=self.cwd)
        self.assertEqual(other.returncode, 0, other.stderr)
        self.refused(1, "of different robots: another ball or floor is believed", "run", "other")


if __name__ == "__main__":
    unittest.main()
