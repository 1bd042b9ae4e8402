"""Runs in Python: the bytes of the command, arrays without copies, Ctrl-C, threads."""
import copy
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import ballast
import numpy as np

BALLAST = os.environ["BALLAST"]


def command(folder, *arguments):
    """Runs `ballast run` and returns (exit status, what it complained of)."""
    done = subprocess.run([BALLAST, "run", *arguments, "--out", folder, "--quiet"], capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


def without_times(summary):
    """The bytes of a summary without the two fields that differ between equal runs."""
    return re.sub(rb'"(wall_time|speed)": [^,\n]*', b"", summary)


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)


class Same(Folder):
    def same_files(self, scenario, *arguments, **options):
        status, _ = command(self.folder / "a", *arguments)
        run = ballast.run(scenario, self.folder / "b", **options)
        self.assertEqual(run.holds, status == 0)
        files = {file.name for file in (self.folder / "a").iterdir()}
        self.assertEqual(files, {file.name for file in (self.folder / "b").iterdir()})
        for name in sorted(files - {"blackbox"}):
            ours, theirs = ((self.folder / part / name).read_bytes() for part in "ab")
            if name == "summary.json":
                ours, theirs = without_times(ours), without_times(theirs)
            self.assertTrue(ours == theirs, name)
        self.assertEqual(run.summary, json.loads((self.folder / "b/summary.json").read_text()))
        return run

    def test_steppers(self):
        run = self.same_files(ballast.Scenario("paper_ball").set("mass.1.mass", 1.25).set("duration", 1), "paper_ball", "--set",
                              "mass.1.mass=1.25", "--set", "duration=1")
        self.assertEqual(run.end_reason, "completed")

    def test_prescribed_with_a_seed(self):
        self.same_files(ballast.Scenario("paper_ball").set("duration", 1.5), "paper_ball", "--set", "duration=1.5",
                        "--actuation", "prescribed", "--seed", "7", actuation="prescribed", seed=7)

    def test_a_trip_with_a_fault_and_its_black_box(self):
        run = self.same_files(ballast.Scenario("paper_ball", faults=["motor_stall@0.5:mass=0"],
                                               set={"duration": 2, "envelope.friction_use": 0.4}),
                              "paper_ball", "--fault", "motor_stall@0.5:mass=0", "--set", "duration=2", "--set",
                              "envelope.friction_use=0.4")
        self.assertEqual(run.end_reason, "tripped")
        box = (run.folder / "blackbox/blackbox.json").read_text()
        self.assertIn(f"{BALLAST} run", box)  # the command that repeats the run can be typed

    def test_lost_steps(self):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ballast.RunWarning)  # of these
            run = self.same_files(ballast.Scenario("paper_ball", faults=["motor_stall@0.5:mass=0"]).set("duration", 2),
                                  "paper_ball", "--fault", "motor_stall@0.5:mass=0", "--set", "duration=2")
        self.assertRegex(run._repr_html_(), "lost microsteps</th><td .*>motor 0: [0-9]+</td>")

    def test_without_a_log(self):
        run = self.same_files(ballast.Scenario("paper_ball").set("duration", 0.1), "paper_ball", "--set", "duration=0.1",
                              "--no-log", log=False)
        with self.assertRaisesRegex(ballast.RunError, "--no-log"):
            run.channels["contact"]

    def test_warnings_are_the_commands(self):
        arguments = ("--set", "duration=1", "--fault", "lost_steps@0.2:mass=0,value=40")
        _, words = command(self.folder / "a", "paper_ball", *arguments)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            ballast.run(ballast.Scenario("paper_ball", faults=[arguments[3]]).set("duration", 1), self.folder / "b")
        self.assertTrue(words)
        self.assertEqual(words, "".join(f"ballast: {w.message}\n" for w in caught if w.category is ballast.RunWarning))

    def test_a_task_without_a_motion_is_warned_of(self):
        subprocess.run([BALLAST, "new", "desk", "--yes"], cwd=self.folder, capture_output=True, check=True)
        task = ballast.Scenario(self.folder / "desk.toml").set("duration", 0.05)
        _, words = command(self.folder / "a", str(task._file), "--set", "duration=0.05")  # pylint: disable=protected-access
        with self.assertWarnsRegex(ballast.RunWarning, "no mass moves") as caught:
            ballast.run(task, self.folder / "b")
        self.assertEqual(words, f"ballast: warning: {caught.warning}\n")
        self.assertIn(str(caught.warning), task.check())


class Refusals(Folder):
    def test_a_folder_that_cannot_be_made(self):
        (self.folder / "file").touch()
        _, words = command(self.folder / "file/x", "paper_ball")
        with self.assertRaises(ballast.RunError) as caught:
            ballast.run("paper_ball", self.folder / "file/x")
        self.assertEqual(words, f"ballast: {caught.exception}\n")

    def test_options_that_are_nonsense(self):
        for options, kind in (({"speed": -1}, ValueError), ({"speed": float("nan")}, ValueError), ({"speed": "x"}, ValueError),
                              ({"seed": -1}, ballast.ScenarioError), ({"seed": 1.5}, ballast.ScenarioError),
                              ({"actuation": "hydraulic"}, ballast.ScenarioError), ({"fast": True}, TypeError)):
            with self.subTest(options), self.assertRaises(kind):
                ballast.run("paper_ball", self.folder / "x", **options)
        self.assertFalse((self.folder / "x").exists())

    def test_a_folder_without_a_run(self):
        with self.assertRaisesRegex(ballast.RunError, "No such file"):
            ballast.Run.load(self.folder)
        for text in ("{", "[]", "3"):
            (self.folder / "summary.json").write_text(text)
            with self.assertRaises(ballast.RunError):
                ballast.Run.load(self.folder)

    def test_a_log_that_is_damaged(self):
        run = ballast.run(ballast.Scenario("paper_ball").set("duration", 0.05), self.folder / "x")
        (run.folder / "run.lcmlog").write_bytes(b"no log" * 100)
        with self.assertRaisesRegex(ballast.RunError, "not an LCM event log"):
            run.channels["contact"]

    def test_a_log_that_is_cut_off(self):
        run = ballast.run(ballast.Scenario("paper_ball").set("duration", 0.05), self.folder / "x")
        log = run.folder / "run.lcmlog"
        log.write_bytes(log.read_bytes()[:-1000])
        with self.assertWarnsRegex(ballast.RunWarning, "cut off inside an event") as caught:
            contact = run.channels["contact"]
        self.assertEqual(caught.filename, __file__)
        self.assertGreater(len(contact), 40)


class Results(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.run_ = ballast.run(ballast.Scenario("paper_ball").set("duration", 1))

    def test_arrays_are_views_of_one_buffer(self):
        contact = self.run_.channels["contact"]
        first, again = contact.normal_force_n, self.run_.channels["BALLAST_CONTACT"].normal_force_n
        self.assertTrue(np.shares_memory(first, again))
        self.assertTrue(np.shares_memory(first, contact.array))
        self.assertEqual(first.dtype, np.dtype(float))
        self.assertEqual(contact.friction_force_W_n.shape, (len(contact), 2))
        with self.assertRaises(ValueError):
            first[0] = 1.0
        self.assertIn("normal_force_n", dir(contact))
        with self.assertRaises(AttributeError):
            contact.no_such_field
        with self.assertRaises(KeyError):
            self.run_.channels["nonsense"]

    def test_the_channels_hold_the_run(self):
        for name in self.run_.channels:
            self.assertIn("tick", self.run_.channels[name].fields)
        contact, state = self.run_.channels["contact"], self.run_.channels["plant_state"]
        self.assertEqual(contact.tick[-1], 1000)
        # The summary's extrema lie between ticks too.
        self.assertGreaterEqual(contact.normal_force_n[contact.tick >= 0].min(), self.run_.summary["normal_force"]["min"])
        np.testing.assert_array_equal(state.position_W_m[-1], self.run_.summary["final"]["position"])

    def test_pictures(self):
        self.assertIn("path", self.run_.pictures())
        figure = self.run_.plot()
        self.assertEqual(type(figure).__module__, "matplotlib.figure")
        with self.assertRaises(ValueError):
            self.run_.plot("nonsense")
        with self.assertRaises(ValueError):
            self.run_.plot("plan_path")  # there is no plan

    def test_a_notebook_gets_table_and_picture(self):
        page = self.run_._repr_html_()
        self.assertRegex(page, "<td [^>]*>completed at t = 1 s</td>")
        self.assertIn("data:image/png;base64,", page)

    def test_matplotlib_stays_the_users(self):
        """In a program of its own, because others here have loaded the pictures: settings and backend as the user has them."""
        script = ("import matplotlib\n"
                  "matplotlib.use('pdf')\n"
                  "matplotlib.rcParams['font.size'] = 21\n"
                  "before = dict(matplotlib.rcParams)\n"
                  "import ballast\n"
                  f"figure = ballast.Run.load({str(self.run_.folder)!r}).plot('path')\n"
                  "assert dict(matplotlib.rcParams) == before\n"
                  "assert figure._repr_png_().startswith(b'\\x89PNG')\n"
                  "assert figure.axes[0].get_xticklabels()[0].get_fontfamily() == ['STIXGeneral']\n")
        subprocess.run([sys.executable, "-B", "-s", "-c", script], check=True)

    def test_the_report(self):
        page = self.run_.show(browser=False)
        self.assertTrue(page.read_bytes().startswith(b"<!doctype html>\n<!-- ballast report -->"))

    def test_a_temporary_folder_goes_with_its_run(self):
        run = ballast.run(ballast.Scenario("paper_ball").set("duration", 0.05))
        folder = run.folder
        self.assertTrue(folder.is_dir())
        self.assertEqual(run.scenario.duration_s, 0.05)
        del run
        self.assertFalse(folder.exists())

    def test_a_temporary_folder_stays_for_what_is_read_from_it(self):
        short = ballast.Scenario("paper_ball").set("duration", 0.05)
        self.assertGreater(len(ballast.run(short).channels["contact"]), 0)
        scenario = ballast.run(short).scenario
        self.assertEqual(scenario.copy().set("duration", 0.04).duration_s, 0.04)
        self.assertEqual(copy.deepcopy(ballast.run(short)).channels["contact"].tick[-1], 50)
        copy.copy(scenario).check()
        folder = Path(scenario._file).parent  # pylint: disable=protected-access
        self.assertTrue(folder.is_dir())
        del scenario
        self.assertFalse(folder.exists())

    def test_the_package_takes_no_names_of_modules(self):
        """Pictures and messages are modules of the package, so `import page` is still the user's."""
        self.run_.plot()
        self.run_.channels["trip"]
        for name in ("pictures", "page", "known", "event_log", "contact_t"):
            self.assertNotIn(name, sys.modules)


class Threads(Folder):
    def test_several_runs_at_once_have_the_bytes_of_one(self):
        def run(number):
            return ballast.run(ballast.Scenario("paper_ball").set("duration", 0.5), self.folder / str(number)).folder

        with ThreadPoolExecutor(4) as pool:
            logs = [(folder / "run.lcmlog").read_bytes() for folder in pool.map(run, range(4))]
        self.assertEqual(len(set(logs)), 1)

    def test_two_runs_in_one_folder_are_refused(self):
        scenario = ballast.Scenario("paper_ball").set("duration", 2)
        thread = threading.Thread(target=ballast.run, args=(scenario, self.folder / "x"), kwargs={"speed": 1})
        thread.start()
        give_up = time.monotonic() + 60  # it is there within milliseconds
        while not (self.folder / "x/robot.json").exists():
            self.assertLess(time.monotonic(), give_up)
            time.sleep(0.01)
        with self.assertRaises(ballast.RunError) as caught:
            ballast.run(scenario, self.folder / "x")
        thread.join()
        self.assertIn("another run", str(caught.exception))
        self.assertTrue(ballast.Run.load(self.folder / "x").holds)

    def test_other_threads_go_on(self):
        """A run at the wall clock's pace, for 0.5 s, leaves the interpreter to others."""
        count, ended = 0, threading.Event()

        def run():
            ballast.run(ballast.Scenario("paper_ball").set("duration", 0.5), self.folder / "x", speed=1)
            ended.set()

        thread = threading.Thread(target=run)
        thread.start()
        while not ended.is_set():
            time.sleep(0.001)
            count += 1
        thread.join()
        self.assertGreater(count, 2)  # some 500 on an idle machine; were the lock held, 1


class Interrupts(Folder):
    def test_ctrl_c_ends_a_run(self):
        """A program that would run for 1000 s gets SIGINT after its first second."""
        script = ("import ballast, sys\n"
                  "try:\n"
                  f"    ballast.run(ballast.Scenario('paper_ball').set('duration', 1000), {str(self.folder / 'x')!r}, speed=1)\n"
                  "except KeyboardInterrupt:\n"
                  "    print('interrupted')\n"
                  "    ballast.run(ballast.Scenario('paper_ball').set('duration', 0.05))\n"
                  "    print('ran again')\n")
        with subprocess.Popen([sys.executable, "-B", "-s", "-c", script], stdout=subprocess.PIPE, text=True) as process:
            log = self.folder / "x/run.lcmlog"
            give_up = time.monotonic() + 120
            while not (log.exists() and log.stat().st_size > 0) and time.monotonic() < give_up:
                time.sleep(0.05)
            process.send_signal(signal.SIGINT)
            output, _ = process.communicate(timeout=60)
        self.assertEqual(output, "interrupted\nran again\n")
        self.assertFalse((self.folder / "x/summary.json").exists())


if __name__ == "__main__":
    unittest.main()
