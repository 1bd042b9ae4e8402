// Numbers and lines of text beside the picture.
import {numberText, shortNumber} from "ballast/numbers.js";
import {FRICTION} from "ballast/panels.js";

const DEGREES = 180 / Math.PI;
const SIGMAS = 2;
const element = (id) => document.getElementById(id);
const percent = (value) => (Number.isFinite(value) ? (100 * value).toFixed(0).replace("-", "−") : "–");
const decimals = (value) => (Number.isFinite(value) ? value.toFixed(3) : "–");
const place = (x, y) => (Number.isFinite(x) ? `${x.toFixed(3)}, ${y.toFixed(3)}`.replace(/-/g, "−") : "–");
const seconds = (time) => (Math.abs(time) < 0.005 ? "0.00" : time.toFixed(2).replace("-", "−"));
const within = (value, sigma) => `${numberText(value)} <small>± ${numberText(SIGMAS * sigma)}</small>`;

// The cards: what a card says of the sample that is shown; `when`: only where the state is so.
const CARDS = [
  {id: "normal_force", label: "<i>N</i>", unit: "N", text: (at) => numberText(at("normal_force"))},
  {
    id: "mu_required",
    label: `${FRICTION}/<i>N</i>`,
    text: (at, {floor}) =>
        `${decimals(at("mu_required"))} <small>of ${Number.isFinite(floor()) ? shortNumber(floor()) : "∞"}</small>`
  },
  {id: "margin", label: "Margin", unit: "%", text: (at) => percent(at("margin"))},
  {id: "least", label: "Least margin seen", unit: "%", text: (at, {least}) => percent(least)},
  {id: "speed", label: "Speed", unit: "m/s", text: (at) => decimals(at("speed"))},
  {id: "place", label: "Place", unit: "m", text: (at) => place(at("position_0"), at("position_1"))},
  {
    id: "backup",
    label: "Certified margin",
    unit: "%",
    when: ({governed}) => governed,
    text: (at) => percent(at("backup_margin"))
  },
  {
    id: "estimated",
    label: "Place as estimated",
    unit: "m",
    when: ({estimated}) => estimated,
    text: (at) => `${place(at("estimated_position_0"), at("estimated_position_1"))} <small>± ${
        numberText(SIGMAS * at("position_sigma"))}</small>`
  },
  {
    id: "attitude",
    label: "Tilt and yaw known to",
    unit: "°",
    when: ({estimated}) => estimated,
    text: (at) =>
        `± ${numberText(SIGMAS * DEGREES * at("tilt_sigma"))}, ${numberText(SIGMAS * DEGREES * at("yaw_sigma"))}`
  },
  {
    id: "measured_mu",
    label: `${FRICTION}/<i>N</i> as measured`,
    when: ({measured}) => measured,
    text: (at) => within(at("measured_mu_required"), at("measured_mu_sigma"))
  },
  {
    id: "measured_normal",
    label: "<i>N</i> as measured",
    unit: "N",
    when: ({measured}) => measured,
    text: (at) => within(at("measured_normal_force"), at("measured_normal_sigma"))
  },
];

// Flags of the state and of what is shown, each with its kind.
const FLAGS = [
  ["good", "ball at rest", ({ball_rests: rests}) => rests],
  ["good", "masses at rest", ({at_rest: rests}) => rests],
  ["good", "governed", ({governed}) => governed],
  ["warn", "command bent", ({bent}) => bent],
  ["warn", "on the certified stop", ({backup}) => backup],
  ["bad", "the robot flags slip", ({slip}) => slip],
  ["bad", "the robot flags light contact", ({light}) => light],
];

export class Readings {
  constructor() {
    this.least = NaN;
    this.cards = new Map(CARDS.map(({id, label, unit}) => {
      const card = document.createElement("div");
      card.dataset.card = id;
      card.innerHTML = `<dt>${label}</dt><dd><b>–</b>${unit ? ` <small>${unit}</small>` : ""}</dd>`;
      element("cards").append(card);
      return [id, card];
    }));
    this.setState({});
  }

  setRun(described) {
    this.described = described;
    this.least = NaN;
    this.rests = false;
  }

  // Every frame counts for the least margin.
  see(margin) {
    if (Number.isFinite(margin) && !(margin >= this.least)) this.least = margin;
  }

  setState(state) {
    this.state = state;
    for (const {id, when} of CARDS) this.cards.get(id).hidden = Boolean(when && !when(state));
    this.showFlags();
  }

  showFlags() {
    const shown = {...this.state, ball_rests: this.rests};
    const flags = FLAGS.filter(([, , holds]) => holds(shown)).map(([kind, text]) => {
      const flag = document.createElement("span");
      [flag.className, flag.textContent] = [kind, text];
      return flag;
    });
    element("flags").replaceChildren(...flags);
  }

  // Shows the sample of that time. `rests`: the ball is at rest.
  show(samples, time, rests) {
    const row = samples.rowAt(time), at = (name) => samples.get(name)?.[row];
    const floor = () =>
        (samples.has("floor_friction") ? at("floor_friction") : this.described.static_friction ?? Infinity);
    for (const {id, text} of CARDS) {
      const card = this.cards.get(id), value = card.querySelector("b");
      if (card.hidden) continue;
      const html = text(at, {least: this.least, floor});
      if (value.innerHTML !== html) value.innerHTML = html;
    }
    const regime = ["rolling", "sliding", "flight"][at("regime")] ?? "", text = rests ? "at rest" : regime;
    const label = element("regime");
    if (label.textContent !== text) [label.textContent, label.className] = [text, `regime ${regime}`];
    element("time").textContent = seconds(time);
    if (rests === this.rests) return;
    this.rests = rests;
    this.showFlags();
  }

  // The last lines in words, newest first, with a rule between two runs.
  say(lines) {
    const newest = [...lines].reverse();
    const items = newest.map(({kind, text, time, run}, k) => {
      const item = document.createElement("li"), when = document.createElement("span");
      item.className = kind;
      item.classList.toggle("another-run", k > 0 && newest[k - 1].run !== run);
      when.className = "when";
      when.textContent = time === undefined ? "" : `${seconds(time)} s`;
      item.append(when, ` ${text}`);
      return item;
    });
    element("said").replaceChildren(...items);
  }
}
