// Draws the panels with uPlot. All of them share one zoom and one time.
import {numberText, shortNumber} from "ballast/numbers.js";
import {BAND_SIGMAS, runLetter} from "ballast/panels.js";
import {color, onThemeChange} from "ballast/theme.js";
import uPlot from "uplot";

const SHADED = ["sliding", "flight"];
const DRAG_STARTS_AT = 6;  // px
export const NUMBERS_EVERY_MS = 80;
const LEAST_SPAN = 1e-4;  // of the whole time
const BAND_OPACITY = 0.18;
// A band reaches at most this many times as far as the lines in it: a wide band would flatten them.
const BAND_IN_SIGHT = 2.5;
const FLAG_COLORS = {
  slip: "bad",
  light: "mass-3"
};
const FONT = "12px system-ui, sans-serif";

// A curve that extends less than this part of its values is drawn as a straight line: its ticks would look alike.
const LEAST_RANGE = 1e-4;

function axisText(value) {
  const size = Math.abs(value), unusual = size >= 1e5 || (size !== 0 && size < 1e-3);
  const text = unusual ? value.toExponential(1) : String(Number(value.toPrecision(6)));
  return text.replace("-", "−");
}

// The last tick of a time axis names the unit.
const timeTexts = (ticks) => ticks.map((tick, i) => axisText(tick) + (i + 1 === ticks.length ? " s" : ""));

// The times of all runs in order, and for each run the index of its sample at that time; -1: none.
function commonGrid(runs) {
  const times = runs.map(({samples}) => samples.time), next = runs.map(() => 0);
  const time = [], rows = runs.map(() => []);
  for (;;) {
    const now = Math.min(...times.map((own, run) => own[next[run]] ?? Infinity));
    if (now === Infinity) return {time, rows};
    time.push(now);
    times.forEach((own, run) => rows[run].push(own[next[run]] === now ? next[run]++ : -1));
  }
}

export class Plots {
  constructor(place, panels, runs, clock) {
    this.clock = clock;
    this.runs = runs;
    this.grid = commonGrid(runs);
    this.range = [0, clock.end || 1];
    this.numbersShownAt = -Infinity;
    this.plots = panels.map((panel) => new Plot(place, panel, runs, this));
    clock.onChange(() => this.showTime());
    this.forgetTheme = onThemeChange(() => this.plots.forEach((plot) => plot.chart.redraw(false, true)));
    this.sizes = new ResizeObserver(() => this.plots.forEach((plot) => plot.resize()));
    this.sizes.observe(place);
    this.showTime();
  }

  // Takes the plots off the page.
  remove() {
    this.forgetTheme();
    this.sizes.disconnect();
    for (const {chart, box} of this.plots) {
      chart.destroy();
      box.remove();
    }
  }

  // While it plays, the numbers change slowly enough to be read.
  showTime() {
    const {time, playing} = this.clock, now = performance.now();
    for (const plot of this.plots) plot.placeNeedle(time);
    if (playing && now - this.numbersShownAt < NUMBERS_EVERY_MS) return;
    this.numbersShownAt = now;
    this.showNumbers(time, this.runs);
  }

  // Shows the numbers of these runs at a time. Their samples have the columns of those that are drawn.
  showNumbers(time, runs) {
    const rows = runs.map(({samples}) => samples.rowAt(time));
    for (const plot of this.plots) plot.showNumbers(time, rows, runs);
  }

  // Draws other samples of the same columns, from one time to another, in one of the plots. Its numbers stay.
  showSamples(number, runs, range) {
    this.runs = runs;
    this.grid = commonGrid(runs);
    this.range = range;
    this.plots[number].showSamples(runs);
  }

  zoomTo(from, to) {
    const whole = this.clock.end || 1;
    const span = Math.min(Math.max(to - from, LEAST_SPAN * whole), whole);
    const start = Math.min(Math.max((from + to - span) / 2, 0), whole - span);
    this.range = [start, start + span];
    for (const plot of this.plots) plot.chart.setScale("x", {min: this.range[0], max: this.range[1]});
    this.showTime();
  }

  // Zooms around a time, which keeps its place.
  zoomBy(factor, around = this.clock.time) {
    const [from, to] = this.range;
    const center = Math.min(Math.max(around, from), to);
    this.zoomTo(center - (center - from) * factor, center + (to - center) * factor);
  }

  zoomAll() {
    this.zoomTo(0, this.clock.end || 1);
  }
}

class Plot {
  constructor(place, panel, runs, all) {
    this.panel = panel;
    this.runs = runs;
    this.all = all;
    this.box = document.createElement("figure");
    this.box.className = "panel";
    this.box.id = `panel-${panel.id}`;
    const unit = panel.unit ? ` <small>[${panel.unit}]</small>` : "";
    this.box.innerHTML = `<figcaption><span class="title">${panel.title}${
        unit}</span><span class="values"></span></figcaption><div class="chart"></div>`;
    place.append(this.box);
    this.edges = (panel.bands ?? []).map((band) => this.edgesOf(band));
    this.values = panel.lines.map((line) => this.addValue(line));
    const chart = this.box.querySelector(".chart");
    chart.setAttribute("role", "img");
    chart.setAttribute("aria-label", `${this.box.querySelector(".title").textContent} over time in s`);
    this.chartBox = chart;
    this.chart = new uPlot(this.options(chart), this.data(), chart);
    this.needle = document.createElement("div");
    this.needle.className = "needle";
    this.selection = document.createElement("div");
    this.selection.className = "selection";
    this.chart.over.append(this.selection, this.needle);
    this.connectPointer(this.chart.over);
  }

  showSamples(runs) {
    this.runs = runs;
    this.edges = (this.panel.bands ?? []).map((band) => this.edgesOf(band));
    this.chart.setData(this.data());
  }

  addValue(line) {
    if (line.label === undefined) return null;
    const item = document.createElement("span");
    item.className = "value";
    item.innerHTML = `<span class="swatch${line.dash ? " dashed" : ""}" style="--swatch: var(--${
        line.color})"></span><span>${line.label}</span> <output aria-live="off"></output>`;
    this.box.querySelector(".values").append(item);
    return item.querySelector("output");
  }

  // uPlot draws across undefined, where only the other run has a sample. It leaves a gap at null, where a value is NaN.
  data() {
    const {time, rows} = this.all.grid;
    return [
      time, ...this.panel.lines.map(({run, column}) => {
        const values = this.runs[run].samples.get(column);
        return Array.from(rows[run], (row) => (row < 0 ? undefined : Number.isNaN(values[row]) ? null : values[row]));
      })
    ];
  }

  // The lower and the upper edge of a band at the samples of its run.
  edgesOf({run, column, sigma, color}) {
    const {samples} = this.runs[run], half = samples.get(sigma), middle = column ? samples.get(column) : undefined;
    const edge = (sign) => Float64Array.from(half, (value, row) => (middle?.[row] ?? 0) + sign * BAND_SIGMAS * value);
    return {time: samples.time, low: edge(-1), high: edge(1), color};
  }

  height() {
    return innerWidth < 700 ? 132 : 150;
  }

  options(chart) {
    const axis =
        {stroke: () => color("muted"), font: FONT, ticks: {show: false}, grid: {stroke: () => color("grid"), width: 1}};
    return {
      width: chart.clientWidth || 300,
      height: this.height(),
      padding: [6, 18, 0, 0],
      legend: {show: false},
      cursor: {show: false},
      select: {show: false},
      scales: {x: {time: false, range: () => this.all.range}, y: {range: (u, low, high) => this.valueRange(low, high)}},
      axes: [
        {...axis, size: 24, gap: 3, space: 60, values: (u, ticks) => timeTexts(ticks)},
        {...axis, size: 54, gap: 4, space: 26, values: (u, ticks) => ticks.map(axisText)},
      ],
      series: [
        {},
        ...this.panel.lines.map(
            (line) => ({stroke: () => color(line.color), width: line.width, dash: line.dash, points: {show: false}}))
      ],
      hooks: {drawClear: [(u) => this.drawShades(u), (u) => this.drawBands(u)], draw: [(u) => this.drawMarks(u)]},
    };
  }

  valueRange(low, high) {
    const {top = Infinity, bottom = -Infinity, limits = []} = this.panel;
    if (low === null || low === undefined) [low, high] = [0, limits[0]?.value ?? 1];
    // Extremes may lie between samples.
    const [from, to] = this.all.range;
    for (const {value, time} of this.panel.extremes ?? []) {
      if (time < from || time > to || value > top || value < bottom) continue;
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    [low, high] = this.withBands(low, high);
    low = Math.max(Math.min(low, top), bottom);
    high = Math.max(Math.min(high, top), low);
    const near = Math.max(Math.abs(low), Math.abs(high));
    for (const {value} of limits) {
      if (Math.abs(value) > 4 * near) continue;
      if (this.panel.id === "normal_force" && low > 3 * (high - low)) continue;  // the limit would flatten the curve
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    if (near <= this.panel.noise || near === 0) return [-0.1, 1];
    const span = high - low, space = span > LEAST_RANGE * near ? 0.09 * span : 0.1 * near || 1;
    return [low - space, high + space];
  }

  // The range with as much of the bands as does not flatten the lines.
  withBands(low, high) {
    if (!this.edges.length) return [low, high];
    const [from, to] = this.all.range;
    let least = Infinity, most = -Infinity;
    for (const edge of this.edges)
      edge.time.forEach((time, row) => {
        if (time < from || time > to || Number.isNaN(edge.low[row])) return;
        least = Math.min(least, edge.low[row]);
        most = Math.max(most, edge.high[row]);
      });
    if (least > most) return [low, high];
    const reach = high > low ? BAND_IN_SIGHT * (high - low) : Infinity;
    return [Math.min(low, Math.max(least, low - reach)), Math.max(high, Math.min(most, high + reach))];
  }

  // Fills each band under the lines, from its least to its greatest in every pixel column.
  drawBands(u) {
    const {ctx, bbox} = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.globalAlpha = BAND_OPACITY;
    for (const edge of this.edges) {
      ctx.fillStyle = color(edge.color);
      for (const columns of this.stretches(u, edge)) {
        ctx.beginPath();
        for (const {x, high} of columns) ctx.lineTo(x, high);
        for (const {x, low} of columns.reverse()) ctx.lineTo(x, low);
        ctx.fill();
      }
    }
    ctx.restore();
  }

  // A band as stretches without a gap, each as {x, low, high} in pixels.
  stretches(u, {time, low, high}) {
    const [from, to] = this.all.range, all = [];
    let columns = [], last = null;
    const close = () => {
      if (columns.length) all.push(columns);
      columns = [];
      last = null;
    };
    const scale = u.scales.y, {top, height} = u.bbox;
    const pixel = (value) => top + height * (1 - (value - scale.min) / (scale.max - scale.min));
    const left = u.bbox.left, perSecond = u.bbox.width / (to - from);
    for (let row = 0; row < time.length; ++row) {
      // One sample beyond either side, so that the band reaches the edge.
      if ((time[row + 1] ?? Infinity) < from || (time[row - 1] ?? -Infinity) > to) continue;
      if (Number.isNaN(low[row]) || Number.isNaN(high[row])) {
        close();
        continue;
      }
      const x = Math.round(left + (time[row] - from) * perSecond), a = pixel(low[row]), b = pixel(high[row]);
      if (last?.x === x) {
        last.low = Math.max(last.low, a);  // pixels count downwards
        last.high = Math.min(last.high, b);
      } else {
        columns.push(last = {x, low: a, high: b});
      }
    }
    close();
    return all;
  }

  // Strips along the upper edge where the robot flags slip, or light contact.
  drawFlags(u) {
    const {ctx, bbox} = u, height = 6 * devicePixelRatio;
    this.runs.forEach(({described}, run) => {
      for (const {what, start_s: start, end_s: end} of described.flags ?? []) {
        const left = u.valToPos(start, "x", true), width = u.valToPos(end, "x", true) - left;
        ctx.fillStyle = color(FLAG_COLORS[what]);
        ctx.fillRect(left, bbox.top + run * height, Math.max(width, 2 * devicePixelRatio), height);
      }
    });
  }

  // Shades regimes other than rolling, under everything else.
  drawShades(u) {
    const {ctx, bbox} = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    this.runs.forEach(({described}, run) => {
      const height = bbox.height / this.runs.length, top = bbox.top + run * height;
      for (const {regime, start, end} of described.regimes) {
        if (!SHADED.includes(regime)) continue;
        const left = u.valToPos(start, "x", true), right = u.valToPos(end, "x", true);
        ctx.fillStyle = color(`shade-${regime}`);
        ctx.fillRect(left, top, Math.max(right - left, 1), height);
      }
    });
    ctx.restore();
  }

  drawMarks(u) {
    const {ctx, bbox} = u, scale = devicePixelRatio;
    ctx.save();
    ctx.setLineDash([]);  // the dashes of an earlier line would remain
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top - 4 * scale, bbox.width, bbox.height + 4 * scale);
    ctx.clip();
    ctx.font = `${12 * scale}px system-ui, sans-serif`;
    ctx.lineWidth = scale;
    this.runs.forEach(({described}, run) => {
      for (const time of described.impacts) this.drawUpright(u, time, [1, 3], "muted");
      for (const {time} of described.events)
        this.drawUpright(u, time, [5, 3, 1, 3], this.runs.length > 1 ? `run-${run}` : "trip", 1.6);
    });
    if (this.panel.flags) this.drawFlags(u);
    this.labels = [];
    const limits = [...this.panel.limits ?? []].sort((a, b) => b.value - a.value);  // labels in the limits' order
    for (const {value, text} of limits) this.drawLimit(u, value, text);
    for (const extreme of this.panel.extremes ?? []) this.drawExtreme(u, extreme);
    ctx.restore();
  }

  drawUpright(u, time, dash, name, width = 1) {
    const {ctx, bbox} = u, x = u.valToPos(time, "x", true);
    ctx.strokeStyle = color(name);
    ctx.lineWidth = width * devicePixelRatio;
    ctx.setLineDash(dash.map((part) => part * devicePixelRatio));
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.setLineDash([]);
  }

  drawLimit(u, value, text) {
    const {ctx, bbox} = u, y = u.valToPos(value, "y", true), scale = devicePixelRatio;
    if (!(y >= bbox.top && y <= bbox.top + bbox.height)) return;
    ctx.strokeStyle = color(text ? "limit" : "muted");
    ctx.lineWidth = scale;
    if (text) ctx.setLineDash([7 * scale, 4 * scale]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.setLineDash([]);
    if (!text) return;
    ctx.textAlign = "right";
    ctx.textBaseline = "middle";
    const right = bbox.left + bbox.width - 4 * scale, width = ctx.measureText(text).width;
    const beside = y + (y - bbox.top > 16 * scale ? -8 : 9) * scale;
    const place = this.freePlace(right - width, width, beside, bbox.top, bbox.top + bbox.height);
    this.write(ctx, text, right, place, "limit");
  }

  drawExtreme(u, {run, value, time, what}) {
    const {ctx, bbox} = u, scale = devicePixelRatio;
    const x = u.valToPos(time, "x", true);
    if (!(x >= bbox.left - 1 && x <= bbox.left + bbox.width + 1)) return;
    const above = u.valToPos(value, "y", true) < bbox.top;
    const y = above ? bbox.top + 5 * scale : u.valToPos(value, "y", true);
    const name = this.runs.length > 1 ? `run-${run}` : this.panel.lines[0].color;
    ctx.beginPath();
    if (above) {
      ctx.moveTo(x - 5 * scale, y + 4 * scale);
      ctx.lineTo(x + 5 * scale, y + 4 * scale);
      ctx.lineTo(x, y - 5 * scale);
      ctx.closePath();
    } else {
      ctx.arc(x, y, 4 * scale, 0, 2 * Math.PI);
    }
    ctx.fillStyle = color("panel");
    ctx.strokeStyle = color(name);
    ctx.lineWidth = 1.8 * scale;
    ctx.fill();
    ctx.stroke();
    const right = x > bbox.left + 0.75 * bbox.width;
    ctx.textAlign = right ? "right" : "left";
    ctx.textBaseline = "middle";
    const who = this.runs.length > 1 ? `${runLetter(run)} ` : "";
    const text = `${who}${what} ${shortNumber(value)}`;
    const begin = x + (right ? -8 : 8) * scale, width = ctx.measureText(text).width;
    const place = this.freePlace(right ? begin - width : begin, width, y, bbox.top, bbox.top + bbox.height);
    this.write(ctx, text, begin, place, "text");
  }

  // The height nearest to `y` at which a label overlaps no other.
  freePlace(from, width, y, top, bottom) {
    const line = 15 * devicePixelRatio, high = top + line / 2, low = bottom - line / 2, gap = 8 * devicePixelRatio;
    const taken = (at) => this.labels.some(
        (other) => other.from < from + width + gap && from < other.to + gap && Math.abs(other.y - at) < 0.99 * line);
    const wanted = Math.min(Math.max(y, high), low), places = [wanted];
    for (let away = line; away < bottom - top; away += line) places.push(wanted + away, wanted - away);
    return places.find((at) => at >= high && at <= low && !taken(at)) ?? wanted;
  }

  // A rim in the background's colour keeps text readable on lines.
  write(ctx, text, x, y, name) {
    const width = ctx.measureText(text).width, from = ctx.textAlign === "right" ? x - width : x;
    this.labels.push({text, from, to: from + width, y});
    ctx.lineWidth = 3 * devicePixelRatio;
    ctx.lineJoin = "round";
    ctx.strokeStyle = color("panel");
    ctx.strokeText(text, x, y);
    ctx.fillStyle = color(name);
    ctx.fillText(text, x, y);
  }

  resize() {
    const width = this.chartBox.clientWidth, height = this.height();
    if (width > 0 && (width !== this.chart.width || height !== this.chart.height)) this.chart.setSize({width, height});
    this.placeNeedle(this.all.clock.time);
  }

  // The needle moves by whole pixels of the screen. It is then sharp, and most frames of a replay change nothing.
  placeNeedle(time) {
    const [from, to] = this.all.range, hidden = time < from || time > to;
    // The width, in pixels of the screen, comes from uPlot: reading it from the page forces a layout in every frame.
    const place = Math.round(((time - from) / (to - from)) * this.chart.bbox.width) / devicePixelRatio;
    if (hidden !== this.needle.hidden) this.needle.hidden = hidden;
    if (hidden || place === this.needlePlace) return;
    this.needlePlace = place;
    this.needle.style.transform = `translateX(${place}px)`;
  }

  showNumbers(time, rows, runs) {
    this.panel.lines.forEach((line, number) => {
      const output = this.values[number];
      if (!output) return;
      const {samples} = runs[line.run];
      const over = time > samples.end + 1e-9;
      const text = over ? "–" : numberText(samples.get(line.column)[rows[line.run]]);
      if (output.textContent !== text) output.textContent = text;
    });
  }

  timeAt(event) {
    const box = this.chart.over.getBoundingClientRect(), [from, to] = this.all.range;
    return from + ((event.clientX - box.left) / box.width) * (to - from);
  }

  connectPointer(over) {
    const {clock} = this.all;
    const pointers = new Map();
    let down = null;   // where a mouse button was pressed
    let pinch = null;  // the times under two fingers
    const release = (event) => {
      pointers.delete(event.pointerId);
      if (pointers.size < 2) pinch = null;
    };
    over.addEventListener("pointerdown", (event) => {
      over.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, event);
      if (event.pointerType === "mouse") {
        if (event.button === 0) down = {x: event.clientX, time: this.timeAt(event), dragged: false};
      } else if (pointers.size === 2) {
        pinch = [...pointers.values()].map((pointer) => this.timeAt(pointer));
      } else {
        clock.pause();
        clock.set(this.timeAt(event));
      }
    });
    over.addEventListener("pointermove", (event) => {
      if (pointers.has(event.pointerId)) pointers.set(event.pointerId, event);
      if (down) {
        down.dragged ||= Math.abs(event.clientX - down.x) > DRAG_STARTS_AT;
        if (down.dragged) this.showSelection(down.time, this.timeAt(event));
      } else if (pinch) {
        this.pinchTo(pinch, [...pointers.values()]);
      } else if (event.pointerType === "mouse" ? !clock.playing : pointers.size === 1) {
        clock.set(this.timeAt(event));
      }
    });
    over.addEventListener("pointerup", (event) => {
      release(event);
      if (!down || event.pointerType !== "mouse") return;
      const time = this.timeAt(event);
      if (down.dragged)
        this.all.zoomTo(Math.min(down.time, time), Math.max(down.time, time));
      else
        clock.set(time);
      down = null;
      this.selection.hidden = true;
    });
    over.addEventListener("pointercancel", (event) => {
      release(event);
      down = null;
      this.selection.hidden = true;
    });
    over.addEventListener("dblclick", () => this.all.zoomAll());
    over.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.shiftKey) return;  // without a key the wheel scrolls the page
      event.preventDefault();
      this.all.zoomBy(Math.exp((event.deltaY || event.deltaX) * 0.003), this.timeAt(event));
    }, {passive: false});
    this.selection.hidden = true;
  }

  showSelection(from, to) {
    const [first, last] = this.all.range, width = this.chart.over.clientWidth;
    const [left, right] =
        [Math.min(from, to), Math.max(from, to)].map((time) => ((time - first) / (last - first)) * width);
    this.selection.hidden = false;
    this.selection.style.left = `${left}px`;
    this.selection.style.width = `${right - left}px`;
  }

  // Zooms so that the times under the fingers stay under them.
  pinchTo([first, second], [a, b]) {
    const box = this.chart.over.getBoundingClientRect();
    const [u, v] = [a, b].map((event) => (event.clientX - box.left) / box.width);
    if (Math.abs(u - v) < 0.02) return;
    const span = (second - first) / (v - u);
    if (span > 0) this.all.zoomTo(first - u * span, first + (1 - u) * span);
  }
}
