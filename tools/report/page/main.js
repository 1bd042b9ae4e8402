// Starts the page: reads the runs, makes plots and replay, and connects slider, buttons and keys to the clock.
import {Clock} from "ballast/clock.js";
import {numberText, shortNumber} from "ballast/numbers.js";
import {BAND_SIGMAS, FRICTION, makePanels, runLetter} from "ballast/panels.js";
import {NUMBERS_EVERY_MS, Plots} from "ballast/plots.js";
import {readSamples} from "ballast/samples.js";
import {Scene} from "ballast/scene.js";
import {connectThemeButton} from "ballast/theme.js";

const LEAST_CIRCLE = 5;  // of a map's 1000
const element = (id) => document.getElementById(id);
const FLAGS = {
  slip: "the robot flags slip",
  light: "the robot flags light contact"
};
const FRAMES_PER_SECOND = 60;  // an arrow key steps by one such frame at the replay's speed

function complain(text) {
  element("trouble").textContent = text;
  element("trouble").hidden = false;
}

async function readRuns() {
  const {runs} = JSON.parse(element("described").textContent);
  return Promise.all(runs.map(
      async (described, run) =>
          ({described, samples: await readSamples(element(`samples-${run}`).textContent, described)})));
}

// The plots work without WebGL; the replay does not.
function makeScene(runs, clock) {
  try {
    return new Scene(element("view"), runs, clock, element("scale"));
  } catch (error) {
    complain(`The replay cannot be shown: ${error.message}`);
    element("view").hidden = element("shows").hidden = true;
    return null;
  }
}

const timeDigits = (end) => (end < 100 ? 3 : 2);

function connectTransport(clock) {
  const slider = element("slider"), play = element("play"), now = element("now"), digits = timeDigits(clock.end);
  slider.max = clock.end;
  slider.addEventListener("input", () => {
    const time = slider.valueAsNumber;  // read before pausing, which moves the thumb back to the replay's time
    clock.pause();
    clock.set(time);
  });
  play.addEventListener("click", () => clock.toggle());
  element("speed").addEventListener("change", (event) => (clock.speed = Number(event.target.value)));
  // While it plays, the thumb moves by whole pixels and the numbers change slowly enough to be read.
  let width = slider.clientWidth, shownAt = -Infinity;
  new ResizeObserver(() => (width = slider.clientWidth)).observe(slider);
  const show = () => {
    if (!clock.playing || Math.abs(clock.time - slider.valueAsNumber) * width >= clock.end)
      slider.valueAsNumber = clock.time;
    if (clock.playing && performance.now() - shownAt < NUMBERS_EVERY_MS) return;
    shownAt = performance.now();
    const text = `${clock.time.toFixed(digits)} s`;
    now.textContent = text;
    slider.setAttribute("aria-valuetext", text);
    play.textContent = clock.playing ? "❚❚" : "▶";
    play.setAttribute("aria-label", clock.playing ? "Pause" : "Play");
  };
  clock.onChange(show);
  show();
}

// Marks regimes and events along the slider.
function markSlider(runs, end) {
  const place = element("marks");
  const add = (name, from, to, title) => {
    const mark = document.createElement("span");
    mark.className = name;
    mark.style.left = `${(100 * from) / end}%`;
    if (to !== undefined) mark.style.width = `${(100 * (to - from)) / end}%`;
    mark.title = title;
    place.append(mark);
  };
  if (!(end > 0)) return;
  for (const {described} of runs) {
    for (const {regime, start, end: until} of described.regimes)
      if (regime !== "rolling") add(regime, start, until, regime);
    for (const {what, start_s: start, end_s: until} of described.flags ?? [])
      add(`flag-${what}`, start, until, FLAGS[what]);
    for (const {time, text} of described.events) add("event", time, undefined, text);
  }
}

// Makes the legend of the shades and lines, which all plots share.
function describeMarks(runs) {
  const place = element("legend"), entries = [];
  const names = new Set(runs.flatMap(({described}) => described.regimes.map(({regime}) => regime)));
  for (const regime of ["sliding", "flight"])
    if (names.has(regime)) entries.push([`box ${regime}`, regime]);
  const flagged = new Set(runs.flatMap(({described}) => (described.flags ?? []).map(({what}) => what)));
  for (const what of flagged) entries.push([`box flag-${what}`, FLAGS[what]]);
  const impacts = runs.reduce((sum, {described}) => sum + described.impacts.length, 0);
  if (impacts) entries.push(["line impact", impacts === 1 ? "impact" : `${impacts} impacts`]);
  runs.forEach(({described}, run) => {
    for (const {time, text} of described.events) {
      const who = runs.length > 1 ? `${runLetter(run)}: ` : "";
      entries.push(
          [`line event run-${runs.length > 1 ? run : "alone"}`, `${who}${text}, t = ${shortNumber(time, 4)} s`]);
    }
  });
  for (const [name, text] of entries) {
    const item = document.createElement("span"), swatch = document.createElement("i");
    swatch.className = name;
    item.append(swatch, text);
    place.append(item);
  }
}

function makeHud(runs, scene, clock) {
  const hud = element("hud");
  const lines = runs.map(({samples, described}, run) => {
    const line = document.createElement("p");
    const letter = runs.length > 1 ? `<b style="color: var(--run-${run})">${runLetter(run)}</b> ` : "";
    const changes = samples.has("floor_friction");
    const limit =
        changes || described.static_friction === null ? "" : ` of ${shortNumber(described.static_friction)}`;
    const factor = scene?.robots[run].frictionFactor ?? 1;
    const longer = factor > 1 ? ` <small>×${factor}</small>` : "";
    line.innerHTML = [
      `${letter}<span class="regime"></span>`,
      `<span class="of-force"><i>N</i> <b></b> N</span>`,
      `<span class="of-friction">${FRICTION} <b></b> N${longer}</span>`,
      `<span class="of-cone">${FRICTION}/<i>N</i> <b></b><small>${limit}</small></span>`,
    ].join(" ");
    if (factor > 1)
      line.querySelector(".of-friction").title = `the arrow of the friction is drawn ${factor} times longer`;
    hud.append(line);
    const limitText = line.querySelector(".of-cone small");
    const [regime, ...numbers] = [line.querySelector(".regime"), ...line.querySelectorAll("span > b")];
    return (time) => {
      const row = samples.rowAt(time);
      const name = ["rolling", "sliding", "flight"][samples.get("regime")[row]] ?? "";
      if (regime.textContent !== name) [regime.textContent, regime.className] = [name, `regime ${name}`];
      ["normal_force", "static_friction", "mu_required"].forEach(
          (column, k) => (numbers[k].textContent = numberText(samples.get(column)[row])));
      if (!changes) return;
      const holds = samples.get("floor_friction")[row];
      limitText.textContent = Number.isFinite(holds) ? ` of ${shortNumber(holds)}` : "";
    };
  });
  let shownAt = -Infinity;
  const show = (time) => {
    const now = performance.now();
    if (clock.playing && now - shownAt < NUMBERS_EVERY_MS) return;
    shownAt = now;
    for (const line of lines) line(time);
  };
  clock.onChange(show);
  show(clock.time);
}

// Moves what is on a map, if the page has it: `marks` maps an element's id to the columns of its place and, for a
// circle of that many sigma, of its radius.
function connectMap(name, marks, [{samples}], clock) {
  const map = element(name);
  if (!map) return;
  const {scale, x, y} = Object.fromEntries(Object.entries(map.dataset).map(([key, value]) => [key, Number(value)]));
  const show = (time) => {
    const row = samples.rowAt(time);
    for (const [id, place, sigma] of marks) {
      const mark = element(id), at = [0, 1].map((j) => samples.get(`${place}_${j}`)?.[row]);
      if (!mark || !at.every(Number.isFinite)) continue;
      mark.setAttribute("cx", x + scale * at[0]);
      mark.setAttribute("cy", y - scale * at[1]);
      if (sigma) mark.setAttribute("r", Math.max(scale * BAND_SIGMAS * samples.get(sigma)[row], LEAST_CIRCLE));
    }
  };
  clock.onChange(show);
  show(clock.time);
}

function connectButtons(scene, plots) {
  for (const button of document.querySelectorAll("[data-camera]"))
    button.addEventListener("click", () => {
      const follow = document.querySelector("[data-show=follow]");
      const follows = button.dataset.camera === "ball";
      if (follow.checked !== follows) follow.click();
      scene?.look(button.dataset.camera);
    });
  for (const box of document.querySelectorAll("[data-show]"))
    box.addEventListener("change", () => scene?.show(box.dataset.show, box.checked));
  for (const button of document.querySelectorAll("[data-zoom]"))
    button.addEventListener(
        "click",
        () => (button.dataset.zoom === "all" ? plots.zoomAll() : plots.zoomBy(button.dataset.zoom === "in" ? 0.5 : 2)));
}

function connectKeys(clock, plots) {
  const step = (direction, event) => {
    clock.pause();
    clock.set(clock.time + (direction * clock.speed * (event.shiftKey ? 10 : 1)) / FRAMES_PER_SECOND);
  };
  const keys = {
    " ": () => clock.toggle(),
    ArrowLeft: (event) => step(-1, event),
    ArrowRight: (event) => step(1, event),
    Home: () => clock.set(0),
    End: () => clock.set(clock.end),
    "+": () => plots.zoomBy(0.5),
    "-": () => plots.zoomBy(2),
    0: () => plots.zoomAll(),
    f: () => document.querySelector("[data-show=follow]").click(),
  };
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || !Object.hasOwn(keys, event.key)) return;
    const {tagName, type} = event.target;
    const isChoice = tagName === "SELECT" || tagName === "SUMMARY" || tagName === "BUTTON" || type === "checkbox";
    // These keys operate the element that has the focus.
    if (isChoice && [" ", "ArrowLeft", "ArrowRight", "Home", "End"].includes(event.key)) return;
    event.preventDefault();
    keys[event.key](event);
  });
}

function start(runs) {
  const clock = new Clock(Math.max(...runs.map(({samples}) => samples.end)));
  connectThemeButton(element("theme"));
  const scene = makeScene(runs, clock);
  const plots = new Plots(element("plots"), makePanels(runs), runs, clock);
  connectTransport(clock);
  markSlider(runs, clock.end);
  describeMarks(runs);
  makeHud(runs, scene, clock);
  connectMap("plan-map", [["plan-here", "position"]], runs, clock);
  connectMap(
      "known-map", [["estimate-here", "estimated_position", "place_error_sigma"], ["truth-here", "position"]], runs,
      clock);
  connectButtons(scene, plots);
  connectKeys(clock, plots);
  let last = 0, drawn = 0, played = false;
  // The first frame after the page was hidden is not measured.
  document.addEventListener("visibilitychange", () => {
    played = false;
  });
  const frame = (now) => {
    // After the page was hidden, the replay continues where it was.
    const seconds = (now - last) / 1000;
    clock.advance(Math.min(seconds, 0.25));
    if (clock.playing && played) scene?.resolution.frame(seconds);
    if (!clock.playing) scene?.resolution.forget();
    played = clock.playing;
    last = now;
    if (scene?.render()) ++drawn;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  return {clock, plots, scene, runs, framesDrawn: () => drawn};
}

// For tests (tests/report) and the browser's console.
window.ballastReport = {};

async function main() {
  const parts = start(await readRuns());
  const nextFrame = () => new Promise(requestAnimationFrame);
  // The first frame lays out and draws; the second one comes when that is done.
  await nextFrame();
  await nextFrame();
  Object.assign(window.ballastReport, parts, {ready: true, readyAfterMs: performance.now()});
}

main().catch((error) => {
  complain(error.message);
  throw error;
});
