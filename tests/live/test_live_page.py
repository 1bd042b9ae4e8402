"""`ballast live` the whole way: a run on a bus, the page in headless Chromium, and an operator who uses it."""

import contextlib
import itertools
import os
import re
import signal
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from browser import DESKTOP, LONGEST_WAIT, PHONE, start_browser

BALLAST = os.environ["BALLAST"]
_buses = itertools.count(20000 + os.getpid() % 8000 * 4)
# With 250 ticks per second a busy machine may keep the reader waiting for 0.2 s until the bus loses messages.
SLOW_TICKS = ["--set", "run.control_period=0.004"]
RUN = ["desk_ball", *SLOW_TICKS, "--set", "duration=3600"]
GOVERNED = ["desk_ball", "--set", "duration=3600", "--set", "control.governor=true", "--set", "run.actuation=ideal"]


def cpu_seconds(processes):
    """Processor time of processes and all that they have started."""
    ticks = 0
    children = {}
    for path in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            fields = (path / "stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
            children.setdefault(int(fields[1]), []).append((int(path.name), int(fields[11]) + int(fields[12])))
    wanted = set(processes)
    for parent in itertools.chain(list(wanted)):
        stack = [parent]
        while stack:
            for pid, spent in children.get(stack.pop(), []):
                ticks += spent
                stack.append(pid)
    return ticks / os.sysconf("SC_CLK_TCK")


class Live(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.browser = start_browser()
        cls.addClassCleanup(cls.browser.quit)
        holder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(holder.cleanup)
        cls.folder = Path(holder.name)

    def setUp(self):
        self.bus = f"udpm://239.255.76.67:{next(_buses) % 40000 + 20000}?ttl=0"
        self.live = subprocess.Popen([BALLAST, "live", "--lcm", self.bus, "--port", "0"], stderr=subprocess.PIPE, text=True)
        self.addCleanup(self.end, self.live)
        self.addCleanup(self.leave)
        self.url = re.match(r"ballast: open (\S+)", self.live.stderr.readline())[1]

    @staticmethod
    def end(process):
        process.send_signal(signal.SIGINT)
        process.wait(LONGEST_WAIT)
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()

    def leave(self):
        """Closes the page, which would go on trying to connect."""
        self.browser.get("about:blank")
        self.browser.get_log("browser")

    def start_run(self, *arguments):
        run = subprocess.Popen([BALLAST, "run", *arguments, "--lcm", self.bus, "--no-log", "--quiet", "--out",
                                self.folder / "run"], cwd=self.folder)
        self.addCleanup(lambda: run.poll() is None and self.end(run))
        return run

    def operate(self, *arguments):
        return subprocess.run([BALLAST, "operate", *arguments, "--lcm", self.bus], capture_output=True, text=True, check=False)

    # The page

    def js(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def open(self, size=DESKTOP):
        width, height = size
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
            "width": width, "height": height, "deviceScaleFactor": 1, "mobile": size == PHONE})
        self.browser.get(self.url)

    def until(self, expression, *arguments):
        """The value of a JavaScript expression, once it is true."""
        deadline = time.monotonic() + LONGEST_WAIT
        while not (value := self.js(f"return {expression}", *arguments)):
            self.assertLess(time.monotonic(), deadline, f"{expression}: {self.text('body')[:2000]}")
            time.sleep(0.05)
        return value

    def text(self, selector):
        return self.js("return document.querySelector(arguments[0])?.innerText ?? ''", selector)

    def until_mode(self, mode):
        self.until("document.getElementById('mode').textContent === arguments[0]", mode)

    def until_said(self, words):
        self.until("document.getElementById('said').innerText.includes(arguments[0])", words)

    def click(self, selector):
        self.browser.find_element(By.CSS_SELECTOR, selector).click()

    def press(self, key):
        self.browser.find_element(By.TAG_NAME, "body").send_keys(key)

    def place(self):
        return self.js("return window.ballastLive.scene.robots[0].body.position.toArray()")

    def until_moved(self, before, distance_m):
        self.until("Math.hypot(...window.ballastLive.scene.robots[0].body.position.toArray().map((x, k) => x - arguments[0][k]))"
                   " > arguments[1]", before, distance_m)

    def assert_clean(self):
        said = [re.sub(r"data:\S*", "data:", entry["message"]) for entry in self.browser.get_log("browser")]
        self.assertEqual(said, [])

    # Tests

    def test_arm_start_and_stop_by_the_keyboard(self):
        self.open()
        self.until("document.getElementById('status').textContent === 'No run is on this bus yet'")
        run = self.start_run(*RUN, "--by-hand")
        self.until_mode("armed")
        self.assertEqual(self.text("#name"), "desk_ball")
        self.until("window.ballastLive.scene !== null && window.ballastLive.drawn > 3")
        before = self.place()
        self.assertAlmostEqual(before[2], 0.15)
        for what in ("arm", "start", "reset"):
            self.assertTrue(self.js("return document.querySelector(`[data-do=${arguments[0]}]`).disabled", what))
        self.click("#take")
        self.until("document.getElementById('holder').textContent.startsWith('You hold the controls')")
        # A refusal has the words of `ballast operate`.
        self.click("[data-do=arm]")
        refusal = self.until("document.querySelector('#answer.refusal')?.textContent")
        self.assertEqual("ballast: " + refusal.split(": ", 1)[1], self.operate("arm").stderr.strip())
        self.assertIn("the controller refuses the arm: it is armed; allowed: arm when disarmed and healthy", refusal)
        self.click("[data-do=start]")
        self.until_mode("running")
        self.until_moved(before, 0.05)
        self.assertGreater(float(self.text("[data-card=speed] b")), 0)
        self.assertNotEqual(self.text("[data-card=normal_force] b"), "–")
        # The space bar stops, though the button that starts has the focus.
        self.assertEqual(self.js("return document.activeElement.dataset.do"), "start")
        self.press(" ")
        self.until_mode("armed")
        self.until_said("stopping, ")
        self.until_said("s; predicted, masses as commanded: least N ")
        self.until_said("armed, at rest at ")
        self.until_said(": stop")
        # One mass moves where it is told.
        self.js("document.getElementById('move-mass').value = '2'; document.getElementById('move-to').value = '0.4';")
        self.click("#move button")
        self.until_said(": move")
        self.until_said("moving, ")
        self.until("Math.abs(window.ballastLive.run.replay.newest('commanded_2') - 0.4) < 1e-3")
        self.until_mode("armed")
        self.js("document.getElementById('move-mass').value = '0'; document.getElementById('move-to').value = '1e14';")
        self.click("#move button")
        self.until_said("the controller refuses the move: mass 0: the target 1e+14 cannot be reached")
        # A viewer that reloads the page has the past, and no longer the controls.
        path = self.js("return window.ballastLive.run.path.points.length")
        self.browser.refresh()
        self.until("window.ballastLive?.run?.path?.points.length >= arguments[0]", path)
        self.until("window.ballastLive.run.trend.rows > 20")
        self.assertIn("Nobody holds the controls", self.text("#holder"))
        self.until_said("armed, at rest at ")
        self.end(run)
        self.until("document.getElementById('status').textContent.startsWith('Nothing heard for ')")
        self.assert_clean()
        # The next run, of another robot, in the same page; it comes to its end.
        self.start_run("paper_ball", "--speed", "1", *SLOW_TICKS, "--set", "duration=6")
        self.until("document.getElementById('name').textContent === 'paper_ball'")
        self.until_mode("running")
        self.until("window.ballastLive.scene.radius === 1")
        self.until_moved(self.place(), 0.1)
        self.assertEqual(self.js("return document.querySelectorAll('#plots .panel').length"), 4)
        self.until_mode("ended")
        self.until_said("the run ended at t = 6 s")
        self.assert_clean()

    def test_a_governed_ball_is_halted_by_the_space_bar(self):
        self.open(PHONE)
        self.start_run(*GOVERNED, "--by-hand")
        self.until_mode("armed")
        self.click("#take")
        self.until("!document.querySelector('[data-do=start]').disabled")
        self.click("[data-do=start]")
        self.until_mode("running")
        self.until("document.querySelector('#flags').innerText.includes('governed')")
        self.until("document.querySelector('#brake').innerText.includes('Halt the ball')")
        self.until_moved([0, 0, 0.15], 0.1)
        self.press(" ")
        self.until_said(": halt")
        self.until_said("the ball will still roll ")
        self.until_said("halting, moving, at ")
        self.until("document.getElementById('mode').textContent === 'armed'")
        self.assertEqual(self.js("return document.documentElement.scrollWidth"), PHONE[0], "wider than the phone")
        self.assert_clean()

    def test_a_trip_is_said_in_words(self):
        self.open()
        self.start_run("desk_ball", "--speed", "1", *SLOW_TICKS, "--set", "envelope.friction_use=0.02")
        trip = self.until("!document.getElementById('trip').hidden && document.getElementById('trip').textContent")
        self.assertRegex(trip, r"^Tripped by the monitor: friction at t = [\d.]+ s: f_s/N was [\d.]+; allowed: <= 0.01")
        self.until_said("tripped by the monitor: friction at t = ")
        self.assert_clean()

    def test_frames_and_memory(self):
        self.open()
        self.start_run("desk_ball", "--speed", "1", *SLOW_TICKS, "--set", "duration=60")
        self.until("window.ballastLive.run?.replay.rows > 100 && window.ballastLive.scene?.resolution.ratio < 0.4")
        counted = "[window.ballastLive.drawn, performance.now() / 1000, window.ballastLive.connection.received]"
        pid = self.browser.service.process.pid
        before, cpu = self.js(f"return {counted}"), cpu_seconds([pid])
        time.sleep(5)
        after, cpu = self.js(f"return {counted}"), cpu_seconds([pid]) - cpu
        frames, seconds, messages = (b - a for a, b in zip(before, after))
        print(f"{frames / seconds:.1f} frames/s, {messages / seconds:.1f} messages/s, {1e3 * cpu / frames:.1f} ms of processor "
              f"time per frame")
        self.assertGreater(frames, 0)
        # Eight hours at 60 frames per second take no more memory than one: rows, path and regimes are bounded.
        sizes = self.js("""
          const page = window.ballastLive, {run} = page, {columns} = run.described, at = (name) => columns.indexOf(name);
          const row = columns.map((name) => run.replay.newest(name) ?? null), sizes = [];
          page.connection.take = {};  // the run's own frames would be in between
          for (let k = 0; k < 8 * 3600 * 60; ++k) {
            const time = 1000 + k / 60;
            [row[at("time")], row[at("position_0")], row[at("position_1")]] = [time, Math.sin(time / 50) * time / 100, time / 80];
            row[at("regime")] = k % 5000 < 20 ? 1 : 0;
            page.frame(row);
            if ((k + 1) % (3600 * 60) === 0)
              sizes.push([run.replay.rows, run.trend.rows, run.path.points.length, run.regimes.spans.length,
                          page.clock.arrivals.length, run.replay.time.length, run.path.geometry.attributes.position.count]);
          }
          return sizes;""")
        for rows, trend, points, spans, arrivals, capacity, vertices in sizes:
            self.assertLessEqual((rows, capacity), (512, 512))
            self.assertLessEqual(trend, 1200)
            self.assertLessEqual(points, 2000)
            self.assertLessEqual(spans, 40)
            self.assertLessEqual(arrivals, 64)
            self.assertEqual(vertices, 4002)


if __name__ == "__main__":
    unittest.main()
