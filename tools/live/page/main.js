// Starts the page: what the server tells goes to replay, plots, readings and controls.
import {Connection} from "ballast/connection.js";
import {Controls} from "ballast/controls.js";
import {FloorGestures} from "ballast/floor_gestures.js";
import {LiveClock} from "ballast/live_clock.js";
import {LivePath} from "ballast/live_path.js";
import {LiveSamples} from "ballast/live_samples.js";
import {FRICTION, makePanels} from "ballast/panels.js";
import {Plots} from "ballast/plots.js";
import {Pointing} from "ballast/pointing.js";
import {Readings} from "ballast/readings.js";
import {Scene} from "ballast/scene.js";
import {placesOf} from "ballast/stroke.js";
import {connectThemeButton} from "ballast/theme.js";

const SHOWN_S = 30, TREND_EVERY_S = 0.05;          // of the plots
const REPLAY_ROWS = 256;                           // 4 s of frames
const PLOT_EVERY_MS = 60, NUMBERS_EVERY_MS = 100;  // one plot at a time, since drawing all takes as long as a frame
const SILENT_AFTER_S = 2;
// The panels of the report that are shown, two of them with shorter titles.
const PANELS = new Map([
  ["normal_force", undefined], ["mu_required", `Friction needed ${FRICTION}/<i>N</i>`], ["margin", undefined],
  ["mass_position", "Masses; dashed: commanded"]
]);
const WEIGHT_ARROW = 1.15;  // of robot.js
const MOST_SPANS = 40;      // of sliding or flight that are shaded in the plots
// The ball is at rest where it has been slower than this part of sqrt(g r) for so long: those of a halt
// (firmware/governor/halt.h). Without gravity, where no halt ends so, than this part of its radius per s.
const REST_SPEED = 0.01, REST_S = 1;
// A drawn path has at most so many places; the accuracy of the line between them, and how near to the ball it begins,
// both in ball radii.
const MOST_PLACES = 4, STROKE_TOLERANCE = 0.15, BEGINS_NEAR = 1.5;

const FLIGHT = 2;  // of the column `regime`

const element = (id) => document.getElementById(id);
const now = () => performance.now() / 1000;

function complain(text) {
  const place = element("trouble");
  place.textContent = text;
  place.hidden = !text;
}

// The spans of a regime other than rolling, as the plots shade them.
class Regimes {
  constructor() {
    this.spans = [];
  }

  see(code, time) {
    const regime = ["rolling", "sliding", "flight"][code], last = this.spans.at(-1);
    if (last && last.regime === regime && last.end <= time) {
      last.end = time;
      return;
    }
    if (last && last.end <= time) last.end = time;
    this.spans.push({regime, start: time, end: time});
    if (this.spans.length > MOST_SPANS) this.spans.shift();
  }
}

// Everything that is drawn of one run.
class Run {
  constructor(described) {
    this.described = {
      ...described,
      regimes: [],
      impacts: [],
      events: [],
      extremes: {},
      commanded: "commanded",
      friction_factor: this.frictionFactor(described.static_friction)
    };
    // Friction under the ball is a column of its own only where the floor changes with the place.
    const names =
        described.columns.map((name) => (name === "floor_friction" && !described.friction_changes ? null : name));
    this.replay = new LiveSamples(names, REPLAY_ROWS);
    this.trend = new LiveSamples(names, Math.ceil(SHOWN_S / TREND_EVERY_S));
    [this.timeColumn, this.speedColumn, this.regimeColumn] =
        ["time", "speed", "regime"].map((name) => described.columns.indexOf(name));
    const {gravity, radius} = described;
    this.restSpeed = REST_SPEED * (gravity > 0 ? Math.sqrt(gravity * radius) : radius);
    this.movedAt = null;  // the last time at which the ball was faster, or in flight; at first, that of the first row
    this.regimes = new Regimes();
    this.described.regimes = this.regimes.spans;
    this.course = this.wish = null;
  }

  // How many times longer the arrow of friction is drawn: as much as keeps it shorter than the ball is wide.
  frictionFactor(limit) {
    return [5, 2].find((factor) => factor * WEIGHT_ARROW * (limit ?? 0.4) <= 1) ?? 1;
  }

  push(row) {
    const time = row[this.timeColumn];
    if (time === null) return;
    this.replay.push(row, time);
    this.trendRow(row, time);
  }

  // Whether the ball is at rest at a time about that of the newest frame.
  restsAt(time) {
    return this.movedAt !== null && time - this.movedAt >= REST_S;
  }

  trendRow(row, time) {
    const {trend} = this, speed = row[this.speedColumn];
    const rests = speed !== null && speed < this.restSpeed && row[this.regimeColumn] !== FLIGHT;
    if (!rests || this.movedAt === null) this.movedAt = time;
    if (trend.rows && time >= trend.end && time < trend.end + TREND_EVERY_S) return;
    trend.push(row, time);
    this.regimes.see(trend.newest("regime"), time);
  }

  history(rows, path) {
    for (const row of rows) this.trendRow(row, row[this.timeColumn]);
    this.way = path;
    if (this.path) this.path.replace(path);
  }

  // Draws the operators' wishes on the floor.
  mark() {
    this.path?.marks.setCourse(this.course);
    this.path?.marks.setWish(this.wish);
  }
}

class Page {
  constructor() {
    this.clock = new LiveClock();
    this.readings = new Readings();
    this.run = this.scene = this.plots = null;
    this.state = {};
    this.arrivedAt = -Infinity;
    this.drawn = this.plottedAt = this.numbersAt = this.last = 0;
    this.turn = 0;
    this.connection = new Connection(
        {
          hello: ({you}) => (this.controls.you = you),
          run: (described) => this.begin(described),
          history: ({rows, path}) => this.run?.history(rows, path),
          frame: ({row}) => this.frame(row),
          state: (state) => this.setState(state),
          course: ({course}) => this.mark({course}),
          wish: ({wish}) => this.mark({wish}),
          said: ({lines}) => this.said(lines),
          controls: ({holder, viewers}) => {
            Object.assign(this.controls, {holder, viewers});
            this.controls.show();
            this.aim();
          },
          refused: ({text}) => this.controls.answer("refusal", text)
        },
        (open, reason) => this.connected(open, reason));
    this.controls = new Controls(this.connection);
    this.connectView();
    requestAnimationFrame((at) => this.draw(at));
  }

  connected(open, reason) {
    this.open = open;
    complain(open ? "" : reason || "No connection to ballast live. Trying again.");
    this.showStatus();
  }

  begin(described) {
    this.run = new Run(described);
    this.clock.reset();
    this.readings.setRun(described);
    this.controls.setRun(described);
    this.isNew = true;
    document.title = `${described.name} – Ballast live`;
    this.showStatus();
  }

  frame(row) {
    const {run} = this;
    if (!run) return;
    run.push(row);
    if (!run.replay.rows) return;
    this.arrivedAt = now();
    this.clock.arrive(run.replay.end, this.arrivedAt);
    this.readings.see(run.replay.newest("margin"));
    if (this.isNew) this.showRun();
    run.path?.add(run.replay.newest("position_0"), run.replay.newest("position_1"), run.replay.newest("regime"));
  }

  // Draws a new run, once it has a sample.
  showRun() {
    const {run} = this;
    this.isNew = false;
    const drawn = [{
      samples: run.replay,
      described: run.described,
      makePath: (robot) => {
        run.path = new LivePath(robot);
        run.path.replace(run.way ?? []);
        run.mark();
        return run.path;
      }
    }];
    try {
      if (this.scene) {
        this.scene.setRuns(drawn);
        this.scene.look("ball");
      } else {
        this.scene = new Scene(element("view"), drawn, this.clock, element("scale"));
        this.pointing = new Pointing(
            this.scene, element("pointed"),
            () => `: ${this.controls.mine ? "a click sends the ball there" : this.controls.without}`);
        this.connectFloor();
      }
      for (const box of document.querySelectorAll("[data-show]"))
        if (!box.checked) this.scene.show(box.dataset.show, false);
    } catch (error) {
      complain(`The ball cannot be shown: ${error.message}`);
    }
    const plotted = [{samples: run.trend.since(-Infinity), described: run.described}];
    this.plots?.remove();
    this.plottedEnds = [];
    const panels = makePanels(plotted)
                       .filter(({id}) => PANELS.has(id))
                       .map((panel) => ({...panel, title: PANELS.get(panel.id) ?? panel.title}));
    this.plots = new Plots(element("plots"), panels, plotted, {time: 0, end: SHOWN_S, playing: true, onChange() {}});
  }

  mark(wishes) {
    if (!this.run) return;
    Object.assign(this.run, wishes);
    this.run.mark();
    if (this.scene) this.scene.dirty = true;
  }

  // Clicks on the floor, and what is drawn on it, become wishes.
  connectFloor() {
    const draw = element("draw");
    this.gestures = new FloorGestures(this.scene, (event) => this.pointing.visiblePlaceAt(event), {
      click: (place) => {
        if (place)
          this.controls.go([place.x, place.y], []);
        else if (this.controls.mine)
          this.controls.answer("refusal", "go: no floor is seen there, but the ball, or what is above the horizon");
      },
      stroke: (points) => {
        this.run.path?.marks.setStroke(points);
        this.scene.dirty = true;
      },
      drawn: (points) => {
        const ball = ["position_0", "position_1"].map((name) => this.run.replay.newest(name)), {radius} = this.scene;
        const places = placesOf(
            points, {most: MOST_PLACES, tolerance: STROKE_TOLERANCE * radius, ball, near: BEGINS_NEAR * radius});
        this.controls.go(places.at(-1), places.slice(0, -1));
      },
      armed: (draws) => draw.setAttribute("aria-pressed", String(draws))
    });
    draw.addEventListener("click", () => this.gestures.arm(!this.gestures.draws));
    this.aim();
  }

  // The pointer over the floor says that a click is a wish.
  aim() {
    element("view").classList.toggle("aims", this.controls.mine);
    if (!this.controls.mine) this.gestures?.arm(false);
  }

  // The last SHOWN_S, or the run so far at the left, in the plot whose turn it is.
  plot(trend) {
    const count = this.plots.plots.length;
    if (!count || this.plottedEnds[this.turn = (this.turn + 1) % count] === trend.end) return;
    this.plottedEnds[this.turn] = trend.end;
    const end = Math.max(trend.end, trend.time[0] + SHOWN_S), from = end - SHOWN_S;
    this.plots.showSamples(this.turn, [{samples: trend.since(from), described: this.run.described}], [from, end]);
  }

  setState(state) {
    this.state = state;
    this.controls.state = state;
    this.controls.show();
    this.readings.setState(state);
    const trip = element("trip"), why = [
      state.trip && `Tripped by the monitor: ${state.trip}`, state.faults && `Fault of the controller: ${state.faults}`
    ];
    trip.textContent = why.filter(Boolean).join(". ");
    trip.hidden = !trip.textContent;
    this.showStatus();
  }

  said(lines) {
    this.readings.say(lines);
    // A change of the mode, which follows an answer, does not take its place.
    const last = lines.findLast(({kind}) => kind !== "mode"), key = JSON.stringify(last ?? null);
    if (last && this.answered !== undefined && key !== this.answered) this.controls.answer(last.kind, last.text);
    this.answered = key;
  }

  showStatus() {
    const {phase, mode, trouble} = this.state, {described} = this.run ?? {};
    const badge = element("mode");
    const text = !this.open ? "not connected" :
        phase === "ended"   ? "ended" :
        phase === "running" ? mode || "prescribed" :
                              "";
    badge.textContent = text;
    badge.hidden = !text;
    badge.className = `badge ${text.replaceAll(" ", "-")}`;
    badge.classList.toggle("of-controller", Boolean(text && text === mode));
    element("name").textContent = described?.name ?? "Waiting for a run";
    const silence = now() - this.arrivedAt;
    const masses = {
      stepper: "stepper-driven masses",
      prescribed: "prescribed masses",
      ideal: "ideal masses"
    }[described?.actuation] ??
        "";
    const says = {
      none: "No run is on this bus yet",
      unknown: trouble || "A run is on this bus; its scenario has not been heard yet",
      ended: "The run has ended; the next one on this bus is shown when it begins",
      running: silence > SILENT_AFTER_S && silence < Infinity ?
          `Nothing heard for ${silence.toFixed(0)} s: the run is paused or lost` :
          masses
    };
    element("status").textContent = this.open ? says[phase] ?? "" : "";
    element("empty").textContent =
        this.run ? "" : "The ball appears here when a run begins:  ballast run SCENARIO --by-hand --lcm URL";
  }

  connectView() {
    connectThemeButton(element("theme"));
    for (const button of document.querySelectorAll("[data-camera]"))
      button.addEventListener("click", () => {
        const follow = document.querySelector("[data-show=follow]"), follows = button.dataset.camera === "ball";
        if (follow.checked !== follows) follow.click();
        this.scene?.look(button.dataset.camera);
      });
    for (const box of document.querySelectorAll("[data-show]"))
      box.addEventListener("change", () => this.scene?.show(box.dataset.show, box.checked));
    addEventListener("keydown", (event) => {
      const typing = /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName) && event.target.type !== "checkbox";
      if (event.key === "f" && !typing && !event.ctrlKey && !event.altKey && !event.metaKey)
        document.querySelector("[data-show=follow]").click();
    });
    // The first frame after the page was hidden is not measured.
    document.addEventListener("visibilitychange", () => (this.last = 0));
  }

  draw(at) {
    const seconds = this.last ? (at - this.last) / 1000 : 0, {scene, run} = this;
    this.last = at;
    if (run?.replay.rows && !this.isNew) {
      const before = this.clock.time;
      this.clock.advance(now(), seconds);
      if (this.clock.time !== before && seconds)
        scene?.resolution.frame(seconds);
      else
        scene?.resolution.forget();
      if (at - this.numbersAt > NUMBERS_EVERY_MS) {
        this.numbersAt = at;
        // Tiles and plots have the same instant in numbers, that of the picture.
        const {time} = this.clock;
        this.readings.show(run.replay, time, run.restsAt(time));
        this.plots.showNumbers(time, [{samples: run.replay}]);
        this.showStatus();
      }
      if (at - this.plottedAt > PLOT_EVERY_MS && run.trend.rows) {
        this.plottedAt = at;
        this.plot(run.trend);
      }
    }
    if (scene?.render()) ++this.drawn;
    requestAnimationFrame((next) => this.draw(next));
  }
}

// For tests (tests/live) and the browser's console.
window.ballastLive = new Page();
