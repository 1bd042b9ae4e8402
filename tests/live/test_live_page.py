"""`ballast live` the whole way: a run on a bus, the page in headless Chromium, and an operator who uses it."""

import contextlib
import itertools
import math
import os
import re
import signal
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.interaction import POINTER_MOUSE, POINTER_TOUCH
from selenium.webdriver.common.actions.pointer_input import PointerInput
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from browser import DESKTOP, LONGEST_WAIT, PHONE, start_browser

BALLAST = os.environ["BALLAST"]
_buses = itertools.count(10000 + os.getpid() % 600 * 16)  # below those of tests/sil/shell.h
# With 250 ticks per second a busy machine may keep the reader waiting for 0.2 s until the bus loses messages.
SLOW_TICKS = ["--set", "run.control_period=0.004"]
RUN = ["desk_ball", *SLOW_TICKS, "--set", "duration=3600"]
# Courses need more ticks per second: a search for a certificate takes a number of ticks while the ball rolls on.
GOES = ["desk_ball", "--by-hand", "--set", "run.control_period=0.002", "--set", "duration=36000", "--set", "control.governor=true",
        "--set", "run.actuation=ideal", "--speed", "2"]
ON_ITS_WAY = ", on its way to ("
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
        self.bus = f"udpm://239.255.76.67:{next(_buses)}?ttl=0"
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

    # The floor

    def see_floor(self, half_m):
        """Looks from above at the floor around the origin, at rest."""
        self.until("window.ballastLive.gestures !== undefined")
        self.js("""
          const follow = document.querySelector("[data-show=follow]"), {scene} = window.ballastLive, target = scene.controls.target;
          if (follow.checked) follow.click();
          scene.lookAt(target.clone().set(0, 0, 0), arguments[0], target.clone().set(-1e-3, -1e-3, 1).normalize());
          scene.render();""", half_m)

    def on_screen(self, place):
        return self.js("""
          const {scene} = window.ballastLive, {left, top, width, height} = scene.renderer.domElement.getBoundingClientRect();
          const at = scene.controls.target.clone().set(...arguments[0], 0).project(scene.camera);
          return [left + (1 + at.x) / 2 * width, top + (1 - at.y) / 2 * height];""", place)

    def stroke(self, *places, kind=POINTER_MOUSE, shift=False):
        """Presses at the first place, moves over the others, and lets go."""
        self.js("document.getElementById('view').scrollIntoView()")
        pointer = PointerInput(kind, kind)
        actions = ActionBuilder(self.browser, mouse=pointer)
        if shift:
            actions.key_action.key_down(Keys.SHIFT)
            actions.key_action.pause()
        for k, place in enumerate(places):
            x, y = self.on_screen(place)
            actions.pointer_action.move_to_location(round(x), round(y))
            if k == 0:
                actions.pointer_action.pointer_down()
        actions.pointer_action.pointer_up()
        if shift:
            for _ in range(len(places) + 1):
                actions.key_action.pause()
            actions.key_action.key_up(Keys.SHIFT)
        actions.perform()

    def tap(self, place, **how):
        self.stroke(place, **how)

    def marks(self, what):
        """The course or the wish that is drawn, or None."""
        return self.js("return window.ballastLive.run.path.marks[arguments[0]]", what)

    def until_course(self, place):
        """The course in force, once it ends near there."""
        return self.until("((to) => to && Math.hypot(to.to[0] - arguments[0], to.to[1] - arguments[1]) < 0.02 && to)"
                          "(window.ballastLive.run.path.marks.course)", *place)

    def take(self):
        self.click("#take")
        self.until("!document.querySelector('#go [type=submit]').disabled")

    def requests(self):
        """Records what the page sends from now on, in window.sent."""
        self.js("window.sent = []; const {connection} = window.ballastLive, send = connection.send;"
                "connection.send = function (op, fields) { window.sent.push(fields ?? {}); return send.call(this, op, fields); }")

    def sent(self):
        return self.js("return window.sent.splice(0)")

    def assert_clean(self):
        said = [re.sub(r"data:\S*", "data:", entry["message"]) for entry in self.browser.get_log("browser")]
        self.assertEqual(said, [])

    # Tests

    def test_arm_start_and_stop_by_the_keyboard(self):
        self.open()
        self.until("document.getElementById('status').textContent === 'No run is on this bus yet'")
        # A stop is not governed: wherever it comes, the ball shall not slip.
        run = self.start_run(*RUN, "--by-hand", "--set", "surface.static_friction=2")
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
        self.assertIn("the controller refuses the arm: it is armed; allowed now: start, move", refusal)
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
        self.until_said("armed, masses at rest at ")
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
        self.until_said("armed, masses at rest at ")
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
        self.assertEqual(self.text("#regime").lower(), "rolling")
        self.press(" ")
        self.until_said(": halt")
        self.until_mode("halting")
        # Another press leaves the halt alone. A stop would let the ball roll on.
        self.press(" ")
        self.until_said(": the ball is being halted already")
        self.until_said("the ball will still roll ")
        self.until_said("halting, masses moving, at ")
        self.until_mode("armed")
        self.until("document.getElementById('flags').innerText.includes('ball at rest')")
        self.assertEqual(self.text("#regime").lower(), "at rest")
        # Nor does it disarm a ball at rest.
        self.press(" ")
        self.until("document.getElementById('said').innerText.match(/viewer \\d+: halt$/gm)?.length === 2")
        self.until_mode("armed")
        # A ball that rolls on under masses at rest is halted, too. A start is refused until one is certified from here.
        self.until("window.ballastLive.state.mode === 'running' || (document.querySelector('[data-do=start]').click(), false)")
        self.until("window.ballastLive.run.replay.newest('speed') > 0.1")
        self.click("#stop")
        self.until_mode("armed")
        self.until("document.getElementById('flags').innerText.includes('masses at rest')")
        self.assertNotIn("ball at rest", self.text("#flags"))
        self.assertGreater(float(self.text("[data-card=speed] b")), 0.05)
        self.press(" ")
        self.until("document.getElementById('flags').innerText.includes('ball at rest')")
        self.until_mode("armed")
        self.assertNotIn("disarmed", self.text("#said"))
        self.assertEqual(self.js("return document.documentElement.scrollWidth"), PHONE[0], "wider than the phone")
        self.assert_clean()

    def test_a_halt_that_is_given_up_is_said(self):
        """On a slope down which the ball rolls, faster and faster, with masses that are too slow to catch it: they hold before
        and after. After 2 s, 20 of the wall clock, N breaks the envelope."""
        self.open()
        slow = (f"mass.{i}.motor.max_acceleration=1" for i in range(3))
        rough = ("surface.static_friction=100", "surface.kinetic_friction=100", "surface.slope.angle=0.25")
        self.start_run(*GOVERNED, "--by-hand", "--speed", "0.1",
                       *itertools.chain.from_iterable(("--set", one) for one in (*slow, *rough)))
        self.until_mode("armed")
        self.take()
        self.press(" ")
        self.until_said(": halt")
        self.until("document.getElementById('answer').innerText.startsWith('the controller refuses the halt: no ')")
        self.assert_clean()

    def test_the_ball_goes_to_five_places_in_a_row(self):
        self.open()
        self.start_run(*GOES)
        self.until_mode("armed")
        self.see_floor(1.2)
        self.take()
        start, rests = self.place()[:2], 0
        for place in ((0.5, 0.0), (0.8, 0.1), (0.3, -0.1), (-0.1, 0.0), (-0.4, 0.1)):
            self.tap(place)
            course = self.until_course(place)
            self.until("document.getElementById('answer').textContent.includes('go: goes to (')")
            to, path = course["to"], course["path"]
            self.assertGreater(len(path), 20)
            before, rests = rests, self.text("#said").count(ON_ITS_WAY)
            if rests == before:  # the course is the whole way
                self.assertLess(math.dist(path[0], start), 2e-3, "the path begins where the ball comes to rest")
            self.assertLess(math.dist(path[-1], to), 1e-3)
            length = math.dist(start, to)
            # The ball is there, and does not only pass.
            self.until("((r) => Math.hypot(r.newest('position_0') - arguments[0], r.newest('position_1') - arguments[1]) < arguments[2]"
                       " && r.newest('speed') < 1e-3)(window.ballastLive.run.replay)", *to, 0.01 * length)
            start = to
        self.until("window.ballastLive.run.path.marks.wish === null")
        said = self.text("#said")
        self.assertEqual(len(re.findall(r"viewer \d+: go to \(.*\) m: planning", said)), 5)
        self.assertEqual(len(re.findall(r"viewer \d+: go: goes to \(.*\) m in [\d.]+ s from tick \d+", said)), 5 + said.count(ON_ITS_WAY))
        self.assert_clean()

    def test_a_long_way_has_a_rest_on_it(self):
        self.open()
        self.start_run(*GOES)
        self.until_mode("armed")
        self.see_floor(1.4)
        self.take()
        to = (1.1, 0.2)
        # The planner is at work while the ball rolls to the rest. A halt ends it, also one that comes with its first words.
        self.tap(to)
        self.until_said(ON_ITS_WAY)
        self.assertIsNotNone(self.marks("wish"))
        self.assertEqual(len(self.planners()), 1)
        self.press(" ")
        self.until_said(": go: dropped by the halt of viewer")
        self.until("window.ballastLive.run.path.marks.wish === null")
        self.assertEqual(self.planners(), [])
        self.until_mode("armed")
        self.tap(to)
        end = self.until_course(to)["to"]
        self.until("window.ballastLive.run.path.marks.wish === null")
        self.until("((r) => Math.hypot(r.newest('position_0') - arguments[0], r.newest('position_1') - arguments[1]) < 0.01"
                   " && r.newest('speed') < 1e-3)(window.ballastLive.run.replay)", *end)
        self.assert_clean()

    def test_a_path_is_drawn_and_followed_by_its_places(self):
        self.open()
        self.start_run(*GOES)
        self.until_mode("armed")
        self.see_floor(1.2)
        self.take()
        self.requests()
        # A drag turns the view, and asks for nothing.
        camera = "return window.ballastLive.scene.camera.position.toArray()"
        before = self.js(camera)
        self.stroke((0.5, 0.2), (0.3, 0.2), (0.1, 0.6))
        self.assertNotEqual(self.js(camera), before)
        self.assertEqual(self.sent(), [])
        self.see_floor(1.2)
        before = self.js(camera)
        drawn = [(0.05, 0.0), (0.2, 0.0), (0.4, 0.02), (0.5, 0.2), (0.5, 0.4), (0.4, 0.5)]
        self.stroke(*drawn, shift=True)
        (sent,) = self.sent()
        self.assertEqual(self.js(camera), before, "a stroke does not turn the view")
        self.assertEqual(sent["do"], "go")
        self.assertLess(math.dist(sent["to"], drawn[-1]), 0.02)
        self.assertTrue(1 <= len(sent["via"]) <= 3, sent)
        self.assertEqual(len(self.until("window.ballastLive.run.path.marks.wish")["via"]), len(sent["via"]))
        course = self.until_course(sent["to"])
        self.assertEqual((course["to"], course["via"]), (sent["to"], sent["via"]))
        for place in sent["via"]:
            self.assertLess(min(math.dist(place, point) for point in course["path"]), 0.03, "the path leads by each place")
        self.until("window.ballastLive.run.path.marks.wish === null")
        # A late viewer sees the same.
        self.browser.refresh()
        self.until("window.ballastLive?.run?.path?.marks.course")
        self.assertEqual(self.marks("course"), course)
        self.assertIsNone(self.marks("wish"))
        # The button does what the shift key does, once, and Esc drops it.
        self.see_floor(1.2)
        self.take()
        self.requests()
        self.click("#draw")
        self.press(Keys.ESCAPE)
        self.assertEqual(self.browser.find_element(By.ID, "draw").get_attribute("aria-pressed"), "false")
        self.click("#draw")
        self.stroke((-0.4, 0.6), (-0.5, 0.2), (-0.6, -0.4))
        (sent,) = self.sent()
        self.assertLess(math.dist(sent["to"], (-0.6, -0.4)), 0.02)
        self.assertEqual(self.browser.find_element(By.ID, "draw").get_attribute("aria-pressed"), "false")
        self.assert_clean()

    def test_a_ball_on_its_backup_is_halted_before_it_goes(self):
        self.open()
        self.start_run(*GOVERNED, "--set", "run.control_period=0.002", "--set", "control.tracking=true", "--set", "duration=200",
                       "--speed", "2", "--fault", "push@3:2,duration=0.3,direction=[0,1,0]")
        self.until_mode("running")
        self.take()
        self.until("document.querySelector('#flags').innerText.includes('on the certified stop')")
        self.see_floor(1.2)
        self.tap((-0.2, 0.7))  # off the path on which it rocks
        self.until_said("halting, masses moving")
        self.until_said(": go: the governor has the ball on its backup: halts it first")
        self.until("window.ballastLive.run.path.marks.wish === null")  # the planner's own end
        self.assertNotIn("another operator", self.text("#said"))
        self.assertNotIn("dropped", self.text("#said"))
        self.assert_clean()

    def test_a_ball_that_has_lost_its_course_goes_on(self):
        self.open()
        # How far the course has come when the push begins depends on this machine; some pushes are mended by feedback alone.
        self.start_run(*GOES, "--fault", "push@20:2.6,duration=0.3,direction=[0,1,0]")
        self.until_mode("armed")
        self.see_floor(1.2)
        self.take()
        self.until("window.ballastLive.run.replay.newest('time') > 14")
        self.tap((0.8, 0.0))
        to = self.until_course((0.8, 0.0))["to"]
        self.until("window.ballastLive.run.replay.newest('time') > 25")
        if "lost its course" in self.text("#said"):
            # Said by the page, or by the planner that waits for the ball at a rest on the way.
            self.until_said("the governor has the ball on its backup: halts it first")
        self.until("((r) => Math.hypot(r.newest('position_0') - arguments[0], r.newest('position_1') - arguments[1]) < 0.01"
                   " && r.newest('speed') < 1e-3)(window.ballastLive.run.replay)", *to)
        self.assertNotIn("again", self.text("#said"))
        self.assert_clean()

    def planners(self):
        """Process numbers of planners that `ballast live` has started."""
        found = []
        for child in Path(f"/proc/{self.live.pid}/task/{self.live.pid}/children").read_text(encoding="utf-8").split():
            with contextlib.suppress(OSError):
                arguments = Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
                if b"go" in arguments:
                    found.append(int(child))
        return found

    def hung_planner(self, before=()):
        """Stops the planner that has just been started, as one that hangs."""
        deadline = time.monotonic() + LONGEST_WAIT
        while not (new := [pid for pid in self.planners() if pid not in before]):
            self.assertLess(time.monotonic(), deadline)
        os.kill(new[0], signal.SIGSTOP)
        return new[0]

    def test_planners_that_hang_and_newer_commands(self):
        self.open()
        run = self.start_run(*GOES)
        self.until_mode("armed")
        self.see_floor(1.2)
        # Without the controls nothing is sent.
        self.requests()
        self.tap((0.4, 0.1))
        self.until("document.getElementById('answer').textContent === "
                   "'go: nobody holds the controls; allowed: take them first'")
        self.assertEqual(self.sent(), [])
        self.take()
        self.tap((0.4, 0.1))
        first = self.hung_planner()
        self.until("window.ballastLive.run.path.marks.wish?.to[0] > 0.3")
        # The page lives while the planner hangs, and a newer wish replaces it.
        self.tap((-0.4, 0.1))
        self.until("window.ballastLive.run.path.marks.wish?.to[0] < -0.3")
        second = self.hung_planner([first])
        self.assertEqual(self.planners(), [second])
        # So does a stop.
        self.press(" ")
        self.until_said(": go: dropped by the halt of viewer")
        self.until("window.ballastLive.run.path.marks.wish === null")
        self.assertEqual(self.planners(), [])
        self.until_mode("armed")
        # And the end of the run.
        self.js("document.getElementById('go-x').value = '0.2'; document.getElementById('go-y').value = '-0.3';")
        self.click("#go [type=submit]")
        self.hung_planner()
        self.end(run)
        self.start_run("desk_ball", "--by-hand", *SLOW_TICKS, "--set", "duration=3600")
        self.until_said(": go: the run ended before the course was planned")
        self.assertEqual(self.planners(), [])
        # The next run has no governor.
        self.until("window.ballastLive.state.mode === 'armed' && window.ballastLive.run.path?.marks.wish === null")
        self.until("!document.querySelector('#go [type=submit]').disabled")
        self.click("#go [type=submit]")
        self.until_said(": go: this run has no governor, which certifies a course: its scenario needs control.governor = true")
        self.assertIsNone(self.marks("course"))
        self.assert_clean()

    def test_a_tap_on_a_phone(self):
        self.open(PHONE)
        self.start_run(*GOES)
        self.until_mode("armed")
        self.take()
        self.see_floor(0.8)
        self.requests()
        self.stroke((0.4, 0.2), (0.2, 0.4), kind=POINTER_TOUCH)
        self.assertEqual(self.sent(), [])
        self.see_floor(0.8)
        self.tap((0.3, 0.2), kind=POINTER_TOUCH)
        (sent,) = self.sent()
        self.assertLess(math.dist(sent["to"], (0.3, 0.2)), 0.02)
        self.until_course(sent["to"])
        self.assertEqual(self.js("return document.documentElement.scrollWidth"), PHONE[0], "wider than the phone")
        # A halt ends the course, and its path is no longer drawn.
        self.press(" ")
        self.until_said(": halt")
        self.until_mode("armed")
        self.until("window.ballastLive.run.path.marks.course === null")
        self.assert_clean()

    def test_wishes_that_are_not_sent_say_why(self):
        self.open()
        self.start_run(*GOES)
        self.until_mode("armed")
        self.see_floor(1.2)
        # Another viewer holds the controls.
        self.js("""
          window.other = new WebSocket(location.href.replace(/^http/, "ws"), "ballast.live.v1");
          window.other.onopen = () => window.other.send('{"op":"take"}');""")
        self.until("window.ballastLive.controls.holder !== null")
        self.requests()
        self.tap((0.4, 0.1))
        self.assertRegex(self.text("#answer"), r"^go: viewer \d+ holds the controls; allowed: take them when they are released$")
        self.assertIn("holds the controls", self.js("return document.getElementById('go').title"))
        self.js("window.other.close()")
        self.until("window.ballastLive.controls.holder === null")
        self.take()
        self.sent()
        # A click on the ball.
        self.tap((0.0, 0.0))
        self.until("document.getElementById('answer').textContent.startsWith('go: no floor is seen there')")
        # Letters in a field of numbers.
        field = self.browser.find_element(By.ID, "go-x")
        field.send_keys("abc")
        self.assertEqual(self.text("#answer"), "go to x: “abc” is no number; allowed: such as −0.25")
        self.assertEqual(field.get_attribute("aria-invalid"), "true")
        self.click("#go [type=submit]")
        self.assertIn("“abc” is no number", self.text("#answer"))
        field.clear()
        field.send_keys("−.5e−1")
        self.assertEqual((self.text("#answer"), field.get_attribute("aria-invalid")), ("", "false"))
        self.click("#go-via")
        self.assertEqual(self.text("#answer"), "go to y: is missing; allowed: a number, such as −0.25")
        move = self.browser.find_element(By.ID, "move-to")
        move.send_keys("1,5")
        self.click("#move button")
        self.assertIn("move to: “1,5” is no number", self.text("#answer"))
        move.clear()
        move.send_keys("1e999")
        self.click("#move button")
        self.assertEqual(self.text("#answer"), "move to: is too large; allowed: below 1000000000000000 in size")
        self.assertEqual(self.sent(), [])
        self.browser.find_element(By.ID, "go-y").send_keys("0.3")
        self.click("#go [type=submit]")
        (sent,) = self.sent()
        self.assertEqual(sent["to"], [-0.05, 0.3])
        self.until_course((-0.05, 0.3))
        self.assert_clean()

    def test_events_name_who_asked(self):
        self.open()
        run = self.start_run(*RUN, "--by-hand")
        self.until_mode("armed")
        self.take()
        # Longer than `ballast move` makes: than the scenario lasts.
        self.js("document.getElementById('move-mass').value = '1'; document.getElementById('move-to').value = '1e6';")
        self.click("#move button")
        self.until_said("s and is taken back; allowed: at most 3600 s; ")
        self.until_mode("armed")
        self.assertRegex(self.text("#answer"), r"^viewer \d+: the move takes [\d.e+]+ s and is taken back")
        # Operators elsewhere.
        self.assertEqual(self.operate("start").returncode, 0)
        self.until_said("another operator: start")
        self.until_mode("running")
        self.assertEqual(self.operate("start").returncode, 1)
        self.until_said("another operator: the controller refuses the start: it is running")
        self.assertEqual(self.operate("stop").returncode, 0)
        self.until_mode("armed")
        said = self.text("#said").splitlines()
        stop = next(k for k, line in enumerate(said) if line.endswith("another operator: stop"))
        self.assertIn("stopping, masses", said[stop - 2] + said[stop - 1], "the command stands before what it brings about")
        # A rule between two runs.
        self.assertEqual(self.js("return document.querySelectorAll('#said .another-run').length"), 0)
        self.end(run)
        self.start_run("paper_ball", "--by-hand", *SLOW_TICKS, "--set", "duration=60")
        self.until("document.getElementById('name').textContent === 'paper_ball'")
        self.until("document.querySelectorAll('#said .another-run').length === 1")
        self.assertIn("run of paper_ball", self.js("""
          const items = [...document.querySelectorAll("#said li")];
          return items.slice(0, items.findIndex((item) => item.classList.contains("another-run"))).map((item) => item.innerText).join();"""))
        self.assert_clean()

    def test_numbers_agree_and_fit(self):
        self.open((1300, 900))
        self.start_run("desk_ball", "--speed", "1", *SLOW_TICKS, "--set", "duration=60")
        self.until("window.ballastLive.run?.replay.rows > 100 && window.ballastLive.plots !== null")
        for _ in range(20):
            tile, plot = self.js("""
              return ["[data-card=normal_force] b", "#panel-normal_force output"].map((at) => document.querySelector(at).textContent);""")
            self.assertEqual(tile, plot)
            time.sleep(0.1)
        self.open((1300, 900))
        self.until("window.ballastLive?.run?.replay.rows > 10")
        for width in (1700, 1300, 1100, 901, 700, PHONE[0]):
            self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
                "width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False})
            clipped = self.js("""
              for (const card of document.querySelectorAll(".cards > [hidden]")) card.hidden = false;
              document.querySelector("[data-card=place] b").textContent = "−123.456, −123.456";
              document.querySelector("[data-card=estimated] b").innerHTML = "−12.345, −12.345 <small>± 0.0246</small>";
              return [...document.querySelectorAll(".cards > div, .cards dd")].filter((box) => box.scrollWidth > box.clientWidth)
                .map((box) => box.innerText);""")
            self.assertEqual(clipped, [], f"at a width of {width} px")
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
