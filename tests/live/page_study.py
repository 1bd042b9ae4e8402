"""How the live page fares over hours: memory and frames per second of a long run that is operated by clicks.

    BALLAST=build/bin/ballast PYTHONPATH=tests/report python3 tests/live/page_study.py SECONDS SPEED

Runs the governed desk ball by hand for SECONDS of simulated time, SPEED times as fast as the wall clock, with the page in
headless Chromium, and sends the ball to a place now and then. It prints a row per interval. This is a study, not a test: no
bound is checked.
"""

import argparse
import contextlib
import itertools
import json
import math
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from selenium.webdriver.common.by import By

from browser import DESKTOP, LONGEST_WAIT, start_browser

ROWS = 24                # unless --every says otherwise
CLICK_EVERY_S = 20       # of the wall clock
WAY_M, GOLDEN = 0.5, math.pi * (3 - math.sqrt(5))  # places lie on a circle of that radius, that angle apart
HALF_VIEW_M = 1.0
LOOK_EVERY_S = 0.2


def resident_mb(pid):
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    return int(re.search(r"VmRSS:\s+(\d+) kB", status)[1]) / 1024


def end(process):
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        process.wait(LONGEST_WAIT)


class Page:
    def __init__(self, browser, url):
        self.browser = browser
        width, height = DESKTOP
        self.cdp("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        browser.get(url)

    def cdp(self, command, **fields):
        return self.browser.execute_cdp_cmd(command, fields)

    def js(self, script, *arguments):
        """The value that a script returns. By execute_script the page would keep 0.1 kB of each call for ever."""
        expression = f"(function() {{{script}}})(...{json.dumps(arguments)})"
        answer = self.cdp("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in answer:
            sys.exit(f"page_study: {answer['exceptionDetails']['exception']['description']}")
        return answer["result"].get("value")

    def until(self, expression):
        deadline = time.monotonic() + LONGEST_WAIT
        while not self.js(f"return {expression}"):
            if time.monotonic() > deadline:
                sys.exit(f"page_study: {expression} did not come true within {LONGEST_WAIT} s")
            time.sleep(LOOK_EVERY_S)

    def take_the_controls(self):
        self.until("document.getElementById('mode').textContent === 'armed' && window.ballastLive.gestures !== undefined")
        self.browser.find_element(By.ID, "take").click()
        self.until("!document.querySelector('#go [type=submit]').disabled")
        self.js("""
          const {scene} = window.ballastLive, {target} = scene.controls;
          document.querySelector("[data-show=follow]").click();
          scene.lookAt(target.clone().set(0, 0, 0), arguments[0], target.clone().set(-1e-3, -1e-3, 1).normalize());
          document.getElementById("view").scrollIntoView();""", HALF_VIEW_M)

    def click(self, place):
        """A click of the mouse at a place of the floor."""
        x, y = self.js("""
          const {scene} = window.ballastLive, {left, top, width, height} = scene.renderer.domElement.getBoundingClientRect();
          const at = scene.controls.target.clone().set(...arguments[0], 0).project(scene.camera);
          return [left + (1 + at.x) / 2 * width, top + (1 - at.y) / 2 * height];""", place)
        for kind in ("mousePressed", "mouseReleased"):
            self.cdp("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def heap_mb(self):
        self.cdp("HeapProfiler.collectGarbage")
        return self.cdp("Runtime.getHeapUsage")["usedSize"] / 2**20

    def simulated_s(self):
        return self.js("return window.ballastLive.run.replay.newest('time')")

    def counted(self):
        """Frames drawn so far, and the page's clock in s."""
        return self.js("return [window.ballastLive.drawn, performance.now() / 1000]")

    def ended(self):
        return self.js("return window.ballastLive.state.phase === 'ended'")


def study(page, live, every_s):
    """Clicks, and prints a row per interval, until the run ends."""
    server = Path(f"/proc/{live.pid}/task/{live.pid}/children").read_text(encoding="utf-8").split()[0]
    clicks = 0
    print(f"{'simulated_s':>12} {'js_heap_mb':>10} {'live_mb':>8} {'server_mb':>9} {'frames_per_s':>12} {'clicks':>6}", flush=True)
    row_at, click_at, before = 0.0, time.monotonic(), page.counted()
    while True:
        ended, now_s = page.ended(), page.simulated_s()
        if now_s >= row_at or ended:
            counted = page.counted()
            frames, wall_s = (b - a for a, b in zip(before, counted))
            print(f"{now_s:12.1f} {page.heap_mb():10.2f} {resident_mb(live.pid):8.1f} {resident_mb(server):9.1f} "
                  f"{frames / wall_s if wall_s > 0 else math.nan:12.1f} {clicks:6}", flush=True)
            row_at, before = now_s + every_s, page.counted()
        if ended:
            return
        if time.monotonic() >= click_at:
            angle = GOLDEN * clicks
            page.click([WAY_M * math.cos(angle), WAY_M * math.sin(angle)])
            clicks, click_at = clicks + 1, time.monotonic() + CLICK_EVERY_S
        time.sleep(LOOK_EVERY_S)


def main():
    parser = argparse.ArgumentParser(prog="page_study.py", description=__doc__.split("\n", 1)[0])
    parser.add_argument("seconds", type=float, help="simulated time in s")
    parser.add_argument("speed", type=float, help="times as fast as the wall clock")
    parser.add_argument("--every", type=float, help=f"simulated seconds between two rows; default: 1/{ROWS} of the run")
    parser.add_argument("--set", action="append", default=[], help="KEY=VALUE of the scenario; can be repeated")
    options = parser.parse_args()
    ballast = os.environ["BALLAST"]
    bus = f"udpm://239.255.76.67:{20000 + os.getpid() % 40000}?ttl=0"
    settings = ["control.governor=true", f"duration={options.seconds:g}", *options.set]
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        browser = start_browser()
        stack.callback(browser.quit)
        live = stack.enter_context(subprocess.Popen([ballast, "live", "--lcm", bus, "--port", "0"], stderr=subprocess.PIPE,
                                                    text=True))
        stack.callback(end, live)
        page = Page(browser, re.match(r"ballast: open (\S+)", live.stderr.readline())[1])
        run = stack.enter_context(subprocess.Popen(
            [ballast, "run", "desk_ball", "--by-hand", "--lcm", bus, "--speed", f"{options.speed:g}", "--no-log", "--quiet",
             "--out", f"{folder}/run", *itertools.chain.from_iterable(("--set", one) for one in settings)]))
        stack.callback(end, run)
        page.take_the_controls()
        study(page, live, options.every or options.seconds / ROWS)
        print("the page's last words: " + page.js("return document.querySelector('#said li')?.innerText ?? ''"))


if __name__ == "__main__":
    main()
