"""The pages in headless Chromium: they load without an error or a request, show what the run's files say, and work."""

import base64
import colorsys
import io
import itertools
import json
import math
import os
import re
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

import ballast
import numpy as np
from matplotlib.image import imread
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

from browser import DESKTOP, LONGEST_WAIT, PHONE, start_browser
from event_log import EventLog
from synthetic_run import KNOWN_SIGMA, ball, believe, place_error_m

SMALL = (600, 500)  # where only loading matters: pixels cost time without a graphics card

# Run before a page's own scripts: WebGL goes by the name of a graphics card, and so the page draws as for one.
NAMED_GRAPHICS_CARD = """
  const getParameter = WebGL2RenderingContext.prototype.getParameter;
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    const isName = name === this.getExtension("WEBGL_debug_renderer_info").UNMASKED_RENDERER_WEBGL;
    return isName ? "a graphics card" : getParameter.call(this, name);
  };"""

# The pixels of a plot, read from a copy: Chromium warns on the console where the page's own canvas is read again and again.
PIXELS = """
  function pixels(chart) {
    const { width, height } = chart.ctx.canvas, copy = new OffscreenCanvas(width, height);
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(chart.ctx.canvas, 0, 0);
    return context.getImageData(0, 0, width, height);
  }
"""


class PageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.browser = start_browser()
        cls.addClassCleanup(cls.browser.quit)
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        cls.run_ballast("paper_ball")
        cls.report("paper_ball")

    @classmethod
    def command(cls, *arguments, expected=(0,)):
        done = subprocess.run([os.environ["BALLAST"], *arguments], capture_output=True, text=True, cwd=cls.folder,
                              check=False)
        assert done.returncode in expected, done.stderr
        return done.stdout

    @classmethod
    def run_ballast(cls, scenario, *more, out=None):
        cls.command("run", scenario, *more, "--out", out or scenario, "--quiet", expected=(0, 3))
        return cls.folder / (out or scenario)

    @classmethod
    def report(cls, run):
        cls.command("report", run)

    def js(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def open(self, page, size=DESKTOP):
        """Loads it, waits until it is ready, and sees that the console is empty and nothing was asked for."""
        self.load(page, size)
        self.assert_clean()

    def load(self, page, size):
        width, height = size
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
            "width": width, "height": height, "deviceScaleFactor": 1, "mobile": size == PHONE})
        self.browser.get((self.folder / page).as_uri())
        start = time.monotonic()
        while not self.js("return window.ballastReport?.ready"):
            trouble = self.js("return document.getElementById('trouble')?.textContent")
            self.assertFalse(trouble)
            self.assertLess(time.monotonic() - start, LONGEST_WAIT, self.console())
            time.sleep(0.05)

    def console(self):
        """What it says since it was last asked; without the modules' texts, which are their addresses."""
        return [re.sub(r"data:\S*", "data:", entry["message"]) for entry in self.browser.get_log("browser")]

    def assert_clean(self):
        self.assertEqual(self.console(), [])
        self.assertTrue(self.js("return document.getElementById('trouble').hidden"))
        asked = self.js("return performance.getEntriesByType('resource').map((entry) => entry.name)")
        self.assertEqual([name for name in asked if not name.startswith(("data:", "blob:"))], [])

    def keep_open(self):
        """The page of the paper's ball, for tests that only look at it."""
        page = (self.folder / "paper_ball/report.html").as_uri()
        if self.browser.current_url != page or self.js("return innerWidth") != DESKTOP[0]:
            self.open("paper_ball/report.html")

    def slide_to(self, seconds):
        self.js("const s = document.getElementById('slider'); s.value = arguments[0]; "
                "s.dispatchEvent(new Event('input', {bubbles: true}));", seconds)

    def ball(self, run=0):
        """Where the replay has the ball and its masses: position, orientation w x y z, masses in space."""
        return self.js("""
          const { scene } = window.ballastReport, robot = scene.robots[arguments[0]], { body } = robot;
          scene.scene.updateMatrixWorld(true);
          const { x, y, z, w } = body.quaternion;
          return { position: body.position.toArray(), orientation: [w, x, y, z],
                   masses: robot.masses.map((mass) => mass.getWorldPosition(mass.position.clone()).toArray()) };
          """, run)

    def state_log(self, run):
        messages = EventLog(self.folder / run / "run.lcmlog", ["BALLAST_PLANT_STATE"]).messages(
            "BALLAST_PLANT_STATE", ballast.plant_state_t)
        return messages[messages["tick"] >= 0]

    def canvas_picture(self):
        path = self.folder / "view.png"
        path.write_bytes(self.browser.find_element(By.ID, "view").screenshot_as_png)
        return imread(path)[..., :3]

    def ranges(self):
        """What the plots show, each from and to."""
        return self.js("return window.ballastReport.plots.plots.map(({ chart }) => "
                       "[chart.scales.x.min, chart.scales.x.max])")

    def slider_time(self):
        return self.js("return document.getElementById('slider').valueAsNumber")

    def test_slider_moves_the_ball_as_the_log_has_it(self):
        self.open("paper_ball/report.html")
        log = self.state_log("paper_ball")
        pictures = []
        for seconds in (0.0, 3.25, 11.0, 20.0):
            self.slide_to(seconds)
            row = int(np.argmin(np.abs(log["time_s"] - seconds)))
            ball = self.ball()
            q, expected = np.array(ball["orientation"]), np.array(log["orientation"][row], dtype=float)
            # float32, and the slider's thumb between two samples: 1e-6 of 10 m.
            self.assertAlmostEqual(abs(q @ expected), 1, delta=1e-6)
            center = np.array(log["position_W_m"][row]) + [0, 0, 1]
            np.testing.assert_allclose(ball["position"], center, atol=1e-5)
            w, v = expected[0], expected[1:]
            for i, place in enumerate(ball["masses"]):
                zeta = np.array(log["mass_position_B_m"][row][i], dtype=float)
                turned = zeta + 2 * np.cross(v, np.cross(v, zeta) + w * zeta)
                np.testing.assert_allclose(place, center + turned, atol=1e-5)
            self.assertEqual(self.js("return document.getElementById('now').textContent"), f"{seconds:.3f} s")
            self.js("return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
            pictures.append(self.canvas_picture())
        for picture in pictures:
            self.assertGreater(picture.std(), 0.03)  # an empty view has its gradient only: 0.01
        self.assertGreater(np.abs(pictures[0] - pictures[2]).max(), 0.3)
        self.assert_clean()

    def test_looks_numbers_are_those_of_the_summary(self):
        self.keep_open()
        summary = json.loads((self.folder / "paper_ball" / "summary.json").read_text())
        shown = self.js("""return [...document.querySelectorAll('[data-path]')].map((e) =>
                           [e.dataset.path, e.dataset.value, e.querySelector('b').textContent])""")
        paths = [path for path, _, _ in shown]
        for path in ("mu_required.max", "normal_force.min", "normal_force.max", "static_friction.max", "end.time"):
            self.assertIn(path, paths)
        for path, exact, text in shown:
            value = summary
            for key in path.split("."):
                value = value[int(key)] if isinstance(value, list) else value[key]
            with self.subTest(path=path):
                self.assertEqual(json.loads(exact), value)
                is_margin = path.endswith("torque_margin")
                self.assertEqual(text, f"{100 * value:.3g}" if is_margin else f"{value:.3g}")
        # The values beside the plots are the log's.
        contact = EventLog(self.folder / "paper_ball" / "run.lcmlog", ["BALLAST_CONTACT"]).messages(
            "BALLAST_CONTACT", ballast.contact_t)
        self.slide_to(5)
        shown = self.js("return document.querySelector('#panel-normal_force output').textContent")
        self.assertAlmostEqual(float(shown), contact["normal_force_n"][contact["tick"] == 5000][0], delta=5e-3)

    def test_looks_every_quantity_has_its_plot(self):
        self.keep_open()
        panels = self.js("return [...document.querySelectorAll('.panel')].map((panel) => panel.id.slice(6))")
        self.assertEqual(panels, ["normal_force", "static_friction", "mu_required", "margin", "angular_velocity",
                                  "mass_position", "deviation", "motor_torque", "motor_margin"])
        # Each has drawn its line: pixels of the line's colour, as many at least as the plot is wide.
        missing = self.js(PIXELS + """
          return window.ballastReport.plots.plots.filter(({ chart, panel }) => {
            const probe = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
            probe.fillStyle = getComputedStyle(document.documentElement).getPropertyValue(`--${panel.lines[0].color}`);
            probe.fillRect(0, 0, 1, 1);
            const [r, g, b] = probe.getImageData(0, 0, 1, 1).data;
            const { width, height, data } = pixels(chart);
            let count = 0;
            for (let k = 0; k < data.length; k += 4)
              if (data[k + 3] > 100 &&
                  Math.abs(data[k] - r) + Math.abs(data[k + 1] - g) + Math.abs(data[k + 2] - b) < 60) ++count;
            return count < 0.5 * width;
          }).map(({ panel }) => panel.id);""")
        self.assertEqual(missing, [])

    def test_plots_and_slider_share_the_time_and_zoom_together(self):
        self.open("paper_ball/report.html")
        over = self.browser.find_element(By.CSS_SELECTOR, "#panel-normal_force .u-over")
        self.js("arguments[0].scrollIntoView({block: 'center'})", over)
        width = over.size["width"]
        ActionChains(self.browser).move_to_element_with_offset(over, int(0.25 * width), 0).perform()
        # From the plot's middle a quarter to the right: three quarters of 20 s; middle and way are whole pixels.
        self.assertAlmostEqual(self.slider_time(), 15, delta=2 * 20 / width)
        needles = self.js("""return window.ballastReport.plots.plots.map(({ needle, chart }) =>
          (new DOMMatrix(getComputedStyle(needle).transform)).m41 / (chart.bbox.width / devicePixelRatio))""")
        # Needles stand on whole pixels.
        self.assertLess(np.abs(np.array(needles) - self.slider_time() / 20).max(), 0.5 / (width - 1))
        ActionChains(self.browser).move_to_element_with_offset(over, int(-0.25 * width), 0).click_and_hold() \
            .move_by_offset(int(0.25 * width), 0).release().perform()
        ranges = self.ranges()
        np.testing.assert_allclose(ranges, [[5, 10]] * len(ranges), atol=2 * 20 / width)
        for _ in range(5):  # on a machine that is busy the two clicks may be too far apart for one double click
            ActionChains(self.browser).double_click(over).perform()
            ranges = np.array(self.ranges())
            if (ranges == [0, 20]).all():
                break
        np.testing.assert_allclose(ranges, [[0, 20]] * len(ranges))

    def touch(self, kind, *points):
        self.browser.execute_cdp_cmd("Input.dispatchTouchEvent", {
            "type": kind, "touchPoints": [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]})

    def test_fingers_on_a_plot(self):
        self.browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 2})
        self.addCleanup(self.browser.execute_cdp_cmd, "Emulation.setTouchEmulationEnabled", {"enabled": False})
        self.open("paper_ball/report.html", PHONE)
        box = self.js("""const over = document.querySelector("#panel-motor_torque .u-over");
          over.scrollIntoView({ block: "end" }); const { left, top, width, height } = over.getBoundingClientRect();
          return { left, y: top + height / 2, width };""")
        at = lambda part: (box["left"] + part * box["width"], box["y"])
        self.touch("touchStart", at(0.5))
        self.assertAlmostEqual(self.slider_time(), 10, delta=20 / box["width"])
        self.touch("touchMove", at(0.75))
        self.assertAlmostEqual(self.slider_time(), 15, delta=20 / box["width"])
        self.touch("touchEnd")
        # Two fingers on 8 s and 12 s, drawn apart to a quarter and three quarters: 4 s are half of what is seen.
        self.touch("touchStart", at(0.4), at(0.6))
        self.touch("touchMove", at(0.25), at(0.75))
        self.touch("touchEnd")
        ranges = self.ranges()
        np.testing.assert_allclose(ranges, [[6, 14]] * len(ranges), atol=3 * 20 / box["width"])
        self.assert_clean()

    def resolution(self, most, first, frames, pixels_matter=None):
        """Where the replay's resolution is after every frame of a made-up screen: frames(ratio, n) are their seconds."""
        return self.browser.execute_async_script("""
          const [most, first, frames, pixelsMatter, done] = arguments;
          const seconds = new Function("ratio", "n", `return ${frames}`);
          import("ballast/resolution.js").then(({Resolution}) => {
            const resolution = new Resolution(most, first, 0.35, pixelsMatter), ratios = [];
            for (let n = 0, time = 0; time < 60; ++n) {
              const frame = seconds(resolution.ratio, n);
              resolution.frame(frame);
              ratios.push([time += frame, resolution.ratio]);
            }
            done(ratios);
          });""", most, first, frames, pixels_matter)

    def test_looks_resolution_follows_the_frames(self):
        self.keep_open()
        on_time = "1 / 60"
        with self.subTest("a fast machine: nothing changes"):
            self.assertEqual({ratio for _, ratio in self.resolution(2, 2, on_time)}, {2})
        with self.subTest("a slow machine: down to the floor in 3 s, and no further"):
            ratios = self.resolution(1, 0.7, "0.02 + 0.4 * ratio * ratio")
            self.assertEqual(min(ratio for _, ratio in ratios), 0.35)
            self.assertEqual({ratio for time, ratio in ratios if time > 3}, {0.35})
        with self.subTest("slow for 10 s, fast from then on: all pixels again"):
            ratios = self.resolution(1, 1, "n < 100 ? 0.1 * ratio : 1 / 60")
            self.assertEqual(min(ratio for _, ratio in ratios), 0.35)
            self.assertEqual(ratios[-1][1], 1)
        with self.subTest("more pixels than 0.5 are late: tried ever more rarely"):
            ratios = self.resolution(1, 1, "ratio > 0.5 ? 0.03 : 1 / 60")
            late = [time for time, ratio in ratios if ratio > 0.5]
            first, last = (sum(start <= time < start + 20 for time in late) for start in (0, 40))
            self.assertGreater(first, 3 * last)
            self.assertLess(last, 0.1 * 60 * 20)
        with self.subTest("30 frames a second whatever is drawn: all pixels"):
            ratios = self.resolution(2, 2, "1 / 30")
            self.assertEqual({ratio for time, ratio in ratios if time > 5}, {2})
        with self.subTest("which then turns out to cost: fewer after all"):
            ratios = self.resolution(2, 2, "n < 300 ? 1 / 30 : 0.02 + 0.1 * ratio")
            self.assertEqual(ratios[-1][1], 0.35)
        with self.subTest("a processor that draws, which others keep busy at first: few pixels stay few"):
            busy = "n < 8 ? 0.05 : n < 200 ? 0.06 : 0.02 + 0.05 * ratio * ratio"
            ratios = self.resolution(1, 0.5, busy, True)
            self.assertEqual({ratio for time, ratio in ratios if time > 1}, {0.35})
        with self.subTest("fewer seemed not to help while the browser was busy: they are tried again"):
            ratios = self.resolution(1, 0.5, "n < 8 ? 0.05 : n < 20 ? 0.3 : 0.02 + 0.05 * ratio * ratio")
            self.assertEqual(max(ratio for _, ratio in ratios), 1)
            self.assertEqual(ratios[-1][1], 0.35)

    def test_looks_little_is_drawn_without_a_graphics_card(self):
        """What a frame costs a processor, as far as it does not depend on the machine; README has the figures."""
        self.keep_open()
        self.slide_to(5)
        drawn = self.js("""const { scene, scene: { renderer } } = window.ballastReport;
          scene.dirty = true; scene.render();
          const { calls, triangles } = renderer.info.render;
          return { calls, triangles, smoothed: renderer.getContextAttributes().antialias };""")
        self.assertLessEqual(drawn["calls"], 19)
        # 5,100; the fine ones are 16,500, and a part as large as the shell that is not made coarser is seen.
        self.assertLess(drawn["triangles"], 6000)
        self.assertFalse(drawn["smoothed"])
        # A clip with round corners is computed in every pixel of the view when the page is put together.
        clipped = self.js("""const faults = [];
          for (let e = document.querySelector("#view canvas"); e; e = e.parentElement) {
            const { overflow, borderRadius } = getComputedStyle(e);
            if (overflow !== "visible" && borderRadius !== "0px") faults.push(e.className);
          }
          return faults;""")
        self.assertEqual(clipped, [])

    def drawn_alone(self, *path):
        """What the replay draws of the part of it that stands there in `scene`: RGBA, rows from the top."""
        png = self.js("""
          const { scene } = window.ballastReport, inPart = new Set(), meshes = [];
          [...arguments].reduce((object, key) => object[key], scene).traverse((object) => inPart.add(object));
          scene.scene.traverse((object) => object.isMesh && meshes.push([object, object.visible]));
          for (const [mesh, visible] of meshes) mesh.visible = visible && inPart.has(mesh);
          scene.dirty = true;
          scene.render();
          const png = scene.renderer.domElement.toDataURL();  // in the same task, or the browser has taken it away
          for (const [mesh, visible] of meshes) mesh.visible = visible;
          scene.dirty = true;
          return png.split(",")[1];""", *path)
        return imread(io.BytesIO(base64.b64decode(png)))

    def shell_on_screen(self):
        """Of the sphere that the camera sees: its middle, from the picture's top left, and radius; pixels."""
        return self.js("""
          const { camera, box, robots: [{ body, radius }] } = window.ballastReport.scene;
          const { x, y } = body.position.clone().project(camera), { clientWidth: width, clientHeight: height } = box;
          const angle = Math.asin(radius / camera.position.distanceTo(body.position));
          return [0.5 * (1 + x) * width, 0.5 * (1 - y) * height,
                  (0.5 * height * Math.tan(angle)) / Math.tan((0.5 * camera.fov * Math.PI) / 180)];""")

    def test_what_a_graphics_card_is_given_to_draw(self):
        """Other materials and triangles than the other tests see; the processor draws these, too."""
        added = self.browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": NAMED_GRAPHICS_CARD})
        self.addCleanup(self.browser.execute_cdp_cmd, "Page.removeScriptToEvaluateOnNewDocument", added)
        self.load("paper_ball/report.html", SMALL)
        self.assertTrue(self.js("return window.ballastReport.scene.renderer.getContextAttributes().antialias"))
        self.assert_shaders_compile()
        self.assert_parts_are_drawn()
        self.assert_slider_moves_what_is_drawn()
        self.assert_clean()  # three.js writes there what the compiler warns of

    def assert_shaders_compile(self):
        faults, error = self.js("""
          const { scene, scene: { renderer } } = window.ballastReport, faults = [], gl = renderer.getContext();
          renderer.debug.checkShaderErrors = true;
          renderer.debug.onShaderError = (gl, program, vertex, fragment) =>
            faults.push(gl.getProgramInfoLog(program) + gl.getShaderInfoLog(vertex) + gl.getShaderInfoLog(fragment));
          scene.scene.traverse(({ material }) => material?.dispose());  // all are compiled anew
          scene.dirty = true;
          scene.render();
          return [faults, gl.getError()];""")
        self.assertEqual(faults, [])
        self.assertEqual(error, 0)

    def assert_parts_are_drawn(self):
        colors = self.js("""const styles = getComputedStyle(document.documentElement), colors = {};
          for (const name of ["floor", "shell", "mass-0", "mass-1", "mass-2"])
            colors[name] = styles.getPropertyValue(`--${name}`);
          window.ballastReport.scene.robots[0].rails.children.forEach(  // their masses', mixed with the background's
            ({ material }, k) => (colors[`rail-${k}`] = `#${material.color.getHexString()}`));
          return colors;""")
        paths = {"floor": ["floor"], "shell": ["robots", 0, "shell"]}
        for k in range(3):
            paths[f"mass-{k}"] = ["robots", 0, "masses", k]
            paths[f"rail-{k}"] = ["robots", 0, "rails", "children", k]
        means = []
        for name, path in paths.items():
            with self.subTest(part=name):
                picture = self.drawn_alone(*path)
                means.append(picture[picture[..., 3] > 0.2][:, :3].mean(axis=0))
                hue, _, value = colorsys.rgb_to_hsv(*means[-1])
                expected_hue, _, expected_value = colorsys.rgb_to_hsv(
                    *(int(colors[name][k:k + 2], 16) / 255 for k in (1, 3, 5)))
                # Light from above leaves the hue; from below it is bluish, by less than 10 degrees.
                self.assertAlmostEqual(hue, expected_hue, delta=10 / 360)
                self.assertGreater(value, 0.5 * expected_value)  # unlit it would be 0
        for one, other in itertools.combinations(means, 2):
            self.assertGreater(np.linalg.norm(one - other), 0.05)  # black and white: 1.7
        alpha = self.drawn_alone("robots", 0, "shell")[..., 3]
        x, y, radius = self.shell_on_screen()
        away = np.hypot(*np.ogrid[0.5 - y:alpha.shape[0] - y, 0.5 - x:alpha.shape[1] - x]) / radius
        # A pixel around the edge is 2 / radius of the disc; the sides of its polygon are 0.3 % of it inside.
        self.assertAlmostEqual((alpha > 0).sum() / (np.pi * radius ** 2), 1, delta=2 / radius)
        # The rim, which this page adds to the shader of three.js, hides at its edge a good third of what is behind it.
        self.assertGreater(np.median(alpha[(away > 0.95) & (away < 0.98)]), np.median(alpha[away < 0.5]) + 0.2)

    def assert_slider_moves_what_is_drawn(self):
        self.browser.find_element(By.CSS_SELECTOR, "[data-camera=path]").click()
        log, places = self.state_log("paper_ball"), []
        for seconds in (0.0, 6.0, 11.0):
            self.slide_to(seconds)
            position = log["position_W_m"][int(np.argmin(np.abs(log["time_s"] - seconds)))]
            np.testing.assert_allclose(self.ball()["position"][:2], position[:2], atol=1e-5)
            rows, columns = np.nonzero(self.drawn_alone("robots", 0, "shell")[..., 3])
            places.append((columns.mean() + 0.5, rows.mean() + 0.5))
            # Off the view's axis a sphere's outline is an ellipse, whose middle is not quite the sphere's.
            np.testing.assert_allclose(places[-1], self.shell_on_screen()[:2], atol=1)
        for one, other in itertools.pairwise(places):
            self.assertGreater(math.dist(one, other), 5)  # pixels

    def test_the_replay_uses_it_while_it_moves_only(self):
        self.open("paper_ball/report.html", SMALL)
        pixels = """const { domElement } = window.ballastReport.scene.renderer; return domElement.width"""
        view = self.js("return document.getElementById('view').clientWidth")

        def wait_for_all_pixels():  # one per pixel of this screen, 0.2 s after the last motion
            start = time.monotonic()
            while self.js(pixels) != view:
                self.assertLess(time.monotonic() - start, LONGEST_WAIT)
                time.sleep(0.05)

        # With fewer pixels the shell is a cage of lines, too; the still picture has the whole of it.
        shell = """const { cage, surface } = window.ballastReport.scene.robots[0];
                   return [cage.visible, ...surface.map((mesh) => mesh.visible)]"""
        wait_for_all_pixels()
        self.assertEqual(self.js(shell), [False, True, True])
        self.js("""const { scene, clock } = window.ballastReport; scene.resolution.ratio = 0.5;
                   clock.set(5); scene.render();
                   window.widthMoving = scene.renderer.domElement.width;
                   const { cage, surface } = scene.robots[0];
                   window.shellMoving = [cage.visible, ...surface.map((mesh) => mesh.visible)];""")
        self.assertEqual(self.js("return window.widthMoving"), view // 2)
        self.assertEqual(self.js("return window.shellMoving"), [True, False, False])
        wait_for_all_pixels()
        self.assertEqual(self.js(shell), [False, True, True])

    def test_keys_and_playing(self):
        self.open("paper_ball/report.html")
        keys = lambda *pressed: ActionChains(self.browser).send_keys(*pressed).perform()
        keys(Keys.END)
        self.assertEqual(self.slider_time(), 20)
        keys(Keys.HOME, Keys.ARROW_RIGHT)
        self.assertAlmostEqual(self.slider_time(), 1 / 60, delta=1e-6)
        rate = self.browser.execute_async_script("""
          const done = arguments[0], { clock, framesDrawn } = window.ballastReport, before = framesDrawn();
          document.body.dispatchEvent(new KeyboardEvent("keydown", { key: " ", bubbles: true }));
          const start = performance.now();
          const frame = (now) => {
            if (now - start < 2000 || framesDrawn() - before < 5) return requestAnimationFrame(frame);
            clock.pause();
            done((1000 * (framesDrawn() - before)) / (now - start));
          };
          requestAnimationFrame(frame);""")
        self.assertGreater(self.slider_time(), 0.1)
        self.js("window.ballastReport.clock.toggle()")
        self.slide_to(5)  # which pauses, there
        self.assertEqual(self.js("const { clock } = window.ballastReport; return [clock.time, clock.playing]"),
                         [5, False])
        self.assertEqual(self.slider_time(), 5)
        cost = self.js("""
          const { clock, scene } = window.ballastReport, start = performance.now();
          for (let k = 0; k < 200; ++k) { clock.set(0.1 * k); scene.render(); }
          return (performance.now() - start) / 200;""")
        ready = self.js("return window.ballastReport.readyAfterMs")
        size = (self.folder / "paper_ball" / "report.html").stat().st_size
        self.assertLess(size, 5e6)
        print(f"\npaper_ball's page: {size / 1e6:.2f} MB, ready after {ready / 1000:.2f} s; playing: {rate:.1f} "
              f"frames/s drawn in software (WebGL by SwiftShader); the scripts' part of a frame: {cost:.2f} ms")

    def layout_faults(self):
        """Blocks of the page that lie on each other, or reach beyond its sides."""
        return self.js("""
          const groups = [".badge, #theme, .brand, .subtitle", "body > *", ".head > *", ".cards > *", ".work > *",
                          ".stage > *", ".transport > *", ".shows > *", ".plots > *", "#plots > *", ".tools > *",
                          ".tables > *", ".hud span", ".cameras > *", ".pair > *"];
          for (const caption of document.querySelectorAll("figcaption"))
            groups.push(`#${caption.parentElement.id} figcaption > *`, `#${caption.parentElement.id} .value`);
          const faults = [], wide = document.documentElement.clientWidth;
          const name = (e) => e.className || e.id || e.tagName;
          const common = (a, b, low, high) => Math.min(a[high], b[high]) - Math.max(a[low], b[low]) > 1;
          for (const group of groups) {
            const boxes = [...document.querySelectorAll(group)].map((e) => [e, e.getBoundingClientRect()])
              .filter(([e, box]) => box.width > 0 && box.height > 0);
            boxes.forEach(([e, a], k) => {
              if (a.left < -0.5 || a.right > wide + 0.5) faults.push(`${group}: ${name(e)} is beyond the side`);
              for (const [f, b] of boxes.slice(k + 1))
                if (!e.contains(f) && !f.contains(e) && common(a, b, "left", "right") && common(a, b, "top", "bottom"))
                  faults.push(`${group}: ${name(e)} on ${name(f)}`);
            });
          }
          const scrolls = document.documentElement.scrollWidth;
          if (scrolls > wide) faults.push(`scrolls sideways: ${scrolls} of ${wide}`);
          return faults;""")

    def test_layout_on_desk_and_phone(self):
        self.run_ballast("hop")
        self.report("hop")
        self.command("compare", "paper_ball", "hop", "--out", "compare.html")
        (self.folder / "log-with-a-name").write_bytes((self.folder / "hop" / "run.lcmlog").read_bytes())
        self.command("report", "log-with-a-name", "--out", "log.html")
        for page in ("paper_ball/report.html", "hop/report.html", "compare.html", "log.html"):
            for size in (DESKTOP, PHONE):
                with self.subTest(page=page, size=size):
                    self.open(page, size)
                    self.assertEqual(self.layout_faults(), [])

    def known_run(self, name, **options):
        """A run with an estimate, a measured contact force and a belief."""
        believe(ball(known=True, controller=True, **options), self.folder / name).write(self.folder / name)
        self.report(name)

    def has_colour(self, panel, seconds, value):
        """Whether something is drawn at that place of a plot."""
        return self.js(PIXELS + """
          const { chart } = window.ballastReport.plots.plots.find(({ panel }) => panel.id === arguments[0]);
          const x = chart.valToPos(arguments[1], "x", true), y = chart.valToPos(arguments[2], "y", true);
          const { width, data } = pixels(chart);
          return data[4 * (Math.round(y) * width + Math.round(x)) + 3] > 0;""", panel, seconds, value)

    def test_estimate_band_and_belief(self):
        self.known_run("known")
        self.known_run("turned", turn_rad=0.5)
        self.command("compare", "known", "turned", "--out", "known-pair.html")
        for size in (PHONE, DESKTOP):
            for page in ("known-pair.html", "known/report.html"):
                with self.subTest(page=page, size=size):
                    self.open(page, size)
                    self.assertEqual(self.layout_faults(), [])
        panels = self.js("return [...document.querySelectorAll('.panel')].map((panel) => panel.id.slice(6))")
        self.assertEqual(panels[4:14], ["measured_mu_required", "measured_mu_error", "measured_normal_force",
                                        "measured_normal_error", "measured_slip", "tilt_error", "yaw_error", "gyro_bias",
                                        "place_error", "believed_off"])
        # The yaw's band reaches 4 degrees to either side of 0. At 10.7 s the error is 3.2, away from the lines of the grid.
        for value, inside in ((-3.6, True), (3.7, True), (4.5, False), (-4.5, False)):
            with self.subTest(value=value):
                self.assertEqual(self.has_colour("yaw_error", 10.7, value), inside)
        self.assertIn("67 % inside", self.js("return document.querySelector('#panel-yaw_error .title').textContent"))
        legend = self.js("return document.getElementById('legend').textContent")
        self.assertIn("the robot flags slip, the first of 2 times, t = 5 s", legend)
        # The estimate's circle on the map is 2 sigma around the estimated place of the page's time.
        self.slide_to(12.0)
        scale, x, y, cx, cy, r = self.js("""
          const { scale, x, y } = document.getElementById("known-map").dataset, mark = document.getElementById("estimate-here");
          return [scale, x, y, ...["cx", "cy", "r"].map((name) => mark.getAttribute(name))].map(Number);""")
        log = self.state_log("known")
        place = np.array(log["position_W_m"][log["tick"] == 120][0][:2]) + place_error_m(12.0)
        # float32 of places of some m, in a drawing of 1000.
        np.testing.assert_allclose([cx, cy, r], [x + scale * place[0], y - scale * place[1],
                                                 2 * KNOWN_SIGMA["place"] * scale], atol=1e-3)

    def test_sliding_flight_and_a_trip_are_marked(self):
        self.run_ballast("paper_detach_flight")
        self.report("paper_detach_flight")
        self.open("paper_detach_flight/report.html")
        legend = self.js("return document.getElementById('legend').textContent")
        for said in ("sliding", "flight", "3 impacts", "trip: the friction came up to its limit"):
            self.assertIn(said, legend)
        summary = json.loads((self.folder / "paper_detach_flight" / "summary.json").read_text())
        flight = next(regime for regime in summary["regimes"] if regime["regime"] == "flight")
        self.slide_to((flight["start"] + flight["end"]) / 2)
        self.assertEqual(self.js("return document.querySelector('.hud .regime').textContent"), "flight")
        self.assertGreater(self.ball()["position"][2], 1)  # the radius: it is above the floor
        self.assertFalse(self.js("return window.ballastReport.scene.robots[0].contact.visible"))

    def test_unusual_runs_load(self):
        (self.folder / "none.toml").write_text(
            'duration = 1\ngravity = 9.81\n[ball]\nradius = 0.2\nmass = 1.5\ninertia = [0.03, 0.03, 0.03]\n'
            '[initial]\nangular_velocity = [0.3, 1, 0.1]\n', encoding="utf-8")
        mass = ('[[mass]]\nmass = 0.5\nrail = {{ shape = "circle", radius = 0.1{0}, direction = {{ azimuth = 0.{0}, '
                'elevation = 0.2 }} }}\ninitial_position = {0}.0\n')
        (self.folder / "eight.toml").write_text((self.folder / "none.toml").read_text()
                                                + "".join(mass.format(k) for k in range(8)))
        cases = {
            "none": ("none.toml",), "eight": ("eight.toml",),
            "perfect": ("paper_ball", "--actuation", "prescribed", "--set", "surface.static_friction=inf"),
            "slipped": ("paper_ball", "--set", "surface.static_friction=0.17"),
            "trajectory": ("tumbleweed",), "detached": ("paper_detach",),
        }
        for name, arguments in cases.items():
            with self.subTest(run=name):
                self.run_ballast(*arguments, out=name)
                self.report(name)
                self.open(f"{name}/report.html", SMALL)
                labels = self.labels_of_friction_needed()
                if name == "slipped":
                    self.assertEqual(labels, {"μs = 0.17", "most 0.17"})

    def labels_of_friction_needed(self):
        """Texts written into that plot; all of them, in every plot, can be read: 15 px is a line."""
        plots = self.js("""return window.ballastReport.plots.plots.map(({ panel, labels }) => [panel.id, labels]);""")
        for panel, labels in plots:
            for a, b in itertools.combinations(labels, 2):
                apart = a["from"] >= b["to"] or b["from"] >= a["to"] or abs(a["y"] - b["y"]) >= 0.98 * 15
                self.assertTrue(apart, (panel, a, b))
        return {label["text"] for label in dict(plots)["mu_required"]}

    def test_a_cut_log_alone(self):
        folder = self.folder / "alone"
        folder.mkdir()
        log = (self.folder / "paper_ball" / "run.lcmlog").read_bytes()
        (folder / "run.lcmlog").write_bytes(log[:len(log) // 3])
        done = subprocess.run([os.environ["BALLAST"], "report", "alone/run.lcmlog"], capture_output=True, text=True,
                              cwd=self.folder, check=True)
        self.assertRegex(done.stderr, r"^ballast-report: run\.lcmlog: cut off .*\. The page shows what comes before\.\n$")
        self.open("alone/report.html")
        notes = self.js("return [...document.querySelectorAll('.note[role=note]')].map((note) => note.textContent)")
        for said in ("no summary.json", "cut off", "no robot.json"):
            self.assertIn(said, " ".join(notes))
        self.slide_to(4)
        self.assertAlmostEqual(self.ball()["position"][2], 1, delta=1e-3)  # the radius with which it rolls

    def test_what_a_run_is_called_cannot_become_part_of_the_page(self):
        folder = self.run_ballast("slide_to_roll", out="named")
        evil = ('</script><img src=x onerror="window.hacked=1"><script>window.hacked=1</script>\u2028\'"&{{samples}} '
                'Ωß')
        summary = json.loads((folder / "summary.json").read_text())
        summary["scenario"] = evil
        summary["end"].update(reason=evil, text=evil)
        summary["trip"] = {"cause": evil, "time": 0.5, "tick": 500, "value": 1, "limit": 0, "latency_ticks": 1}
        summary["surfaces"] = [{"name": evil, "mu_s": 0.5, "holds": True}]
        summary["published"] = [{"quantity": evil, "published": 1, "here": None, "source": evil}]
        (folder / "summary.json").write_text(json.dumps(summary))
        self.report("named")
        self.command("compare", "named", "paper_ball", "--out", "named/compare.html")
        for page in ("named/report.html", "named/compare.html"):
            self.open(page)
            self.assertIn(evil, self.js("return document.querySelector('h1').textContent"))
            self.assertIsNone(self.js("return window.hacked ?? null"))
            self.assertEqual(self.js("return document.querySelectorAll('img').length"), 0)
            self.assertEqual(self.js("return window.ballastReport.runs[0].described.name"), evil)

    def test_two_runs(self):
        self.run_ballast("paper_ball", "--set", "envelope.friction_use=0.5", out="stopped")
        self.command("compare", "paper_ball", "stopped", "--out", "two.html")
        self.open("two.html")
        end = json.loads((self.folder / "stopped" / "summary.json").read_text())["end"]["time"]
        logs = [self.state_log(run) for run in ("paper_ball", "stopped")]
        for seconds in (4.0, 7.0):
            self.slide_to(seconds)
            for run, log in enumerate(logs):
                row = int(np.argmin(np.abs(log["time_s"] - seconds)))
                np.testing.assert_allclose(self.ball(run)["position"][:2], log["position_W_m"][row][:2], atol=1e-5)
        self.run_ballast("paper_ball", "--set", "envelope.friction_use=0.9", "--set", "surface.static_friction=0.33",
                         out="other")
        self.command("compare", "stopped", "other", "--out", "limits.html")
        self.open("limits.html")
        self.assertLessEqual({"μs A = 0.35", "monitor's limit A 0.175", "μs B = 0.33", "monitor's limit B 0.297"},
                             self.labels_of_friction_needed())
        self.open("two.html")
        self.slide_to(end + 1)  # beyond the end of the second
        shown = self.js("return [...document.querySelectorAll('#panel-normal_force output')].map((o) => o.textContent)")
        self.assertTrue(math.isfinite(float(shown[0])))
        self.assertEqual(shown[1], "–")
        self.assertIn("envelope.friction_use", self.js("return document.querySelector('.tables').textContent"))

    def test_looks_licences_travel_with_the_page(self):
        self.keep_open()
        text = self.js("return document.querySelector('footer details').textContent")
        for said in ("three", "uplot", "Permission is hereby granted", "three.js authors", "Leon Sorokin"):
            self.assertIn(said, text)


if __name__ == "__main__":
    unittest.main()
