// The operator's controls: who holds them, the buttons, the keys, and what became of a request.
import {numberIn, numberTrouble, watchNumbers} from "ballast/number_field.js";
import {shortNumber} from "ballast/numbers.js";

const element = (id) => document.getElementById(id);
const BRAKES = ["stop", "brake"];
// The modes in which a command is usually obeyed. Others are dimmed, and say why if they are asked for.
const USUAL = {
  arm: ["disarmed"],
  start: ["armed"],
  reset: ["tripped"],
  stop: ["armed", "running", "moving", "stopping", "about to move", "halting"],
  brake: ["armed", "running", "moving", "stopping", "about to move", "halting"]
};

export class Controls {
  constructor(connection) {
    this.connection = connection;
    this.you = this.holder = null;
    this.viewers = 0;
    this.state = {};
    this.buttons = [...document.querySelectorAll("[data-do]")];
    for (const button of this.buttons) button.addEventListener("click", () => this.command(button.dataset.do));
    element("take").addEventListener("click", () => connection.send(this.mine ? "release" : "take"));
    element("move").addEventListener("submit", (event) => {
      event.preventDefault();
      if (!this.hasNumbers("move-to")) return;
      this.command("move", {
        mass: Number(element("move-mass").value),
        to: numberIn(element("move-to")),
        speed_fraction: Number(element("move-speed").value)
      });
    });
    element("move-mass").addEventListener("change", () => this.showUnit());
    this.via = [];  // places on the way that have been entered
    element("go").addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.hasNumbers("go-x", "go-y")) this.go(this.enteredPlace(), this.via);
    });
    element("go-via").addEventListener("click", () => {
      if (this.hasNumbers("go-x", "go-y")) this.setVia([...this.via, this.enteredPlace()]);
    });
    watchNumbers(document.querySelectorAll("[data-number]"), (why) => this.answer(why ? "refusal" : "", why));
    this.connectKeys();
    this.show();
  }

  get mine() {
    return this.holder !== null && this.holder === this.you;
  }

  // Why this viewer's wishes are not sent, except a stop or a halt.
  get without() {
    return this.holder ? `${this.holder} holds the controls; allowed: take them when they are released` :
                         "nobody holds the controls; allowed: take them first";
  }

  // Whether these fields have numbers. Else it says why not.
  hasNumbers(...ids) {
    const wrong = ids.map(element).find(numberTrouble);
    if (!wrong) return true;
    this.answer("refusal", numberTrouble(wrong));
    wrong.focus();
    return false;
  }

  command(what, fields = {}) {
    if (!this.connection.send("command", {do: what, ...fields}))
      this.answer("refusal", "not sent: there is no connection");
  }

  // Asks for a course to `to` by the places `via`, each [x, y] in m.
  go(to, via) {
    if (!this.mine) {
      this.answer("refusal", `go: ${this.without}`);
      return;
    }
    const rounded = (place) => place.map((x) => Number(x.toFixed(6)));
    this.command("go", {to: rounded(to), via: via.map(rounded)});
    this.setVia([]);
  }

  enteredPlace() {
    return ["go-x", "go-y"].map((id) => numberIn(element(id)));
  }

  setVia(via) {
    this.via = via;
    element("go-by").textContent = via.map(([x, y]) => `by ${shortNumber(x)}, ${shortNumber(y)}`).join("; ");
  }

  // Space stops whatever has the focus: a focused button would be pressed by it.
  connectKeys() {
    addEventListener("keydown", (event) => {
      if (event.key !== " " || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      if (!event.repeat) this.command("brake");
    }, true);
    addEventListener("keyup", (event) => {
      if (event.key === " ") event.preventDefault();
    }, true);
  }

  answer(kind, text) {
    const place = element("answer");
    place.textContent = text;
    place.className = `answer ${kind}`;
  }

  setRun({masses}) {
    this.masses = masses;
    element("move-mass").replaceChildren(...masses.map((_, i) => new Option(String(i), i)));
    element("move-to").value = "";
    this.setVia([]);
    this.showUnit();
  }

  showUnit() {
    const mass = this.masses?.[element("move-mass").value];
    element("move-unit").textContent = mass?.unit ?? "";
    const [low, high] = [mass?.lower_end ?? null, mass?.upper_end ?? null];
    element("move-to").placeholder = low !== null && high !== null ? `${shortNumber(low)} to ${shortNumber(high)}` : "";
  }

  show() {
    const {mine, holder, viewers, state: {mode, governor}} = this;
    const works = Boolean(mode) && this.state.phase === "running";
    const others = viewers > 1 ? `${viewers} viewers` : "one viewer";
    element("holder").textContent = mine ? `You hold the controls (${this.you}; ${others})` :
        holder ? `${holder} holds the controls (you are ${this.you}; ${others})` :
                 `Nobody holds the controls (${others})`;
    const take = element("take");
    take.textContent = mine ? "Release" : "Take the controls";
    take.disabled = !mine && holder !== null;
    for (const button of this.buttons) {
      const what = button.dataset.do;
      button.disabled = !works || !(mine || BRAKES.includes(what));
      button.classList.toggle("usual", works && USUAL[what].includes(mode));
    }
    for (const form of ["move", "go"]) {
      element(form).title = mine ? "" : this.without;
      for (const input of element(form).elements) input.disabled = !works || !mine;
    }
    element("stop").hidden = !governor;
    element("brake").firstChild.textContent = governor ? "Halt the ball " : "Stop ";
  }
}
