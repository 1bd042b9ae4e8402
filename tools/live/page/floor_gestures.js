// Clicks and strokes on the floor, told from the drags that turn the view.

const SLOP_PX = {
  mouse: 4,
  pen: 8,
  touch: 12
};                         // a press that moves further is a drag
const CLOSEST = 0.05;      // distance of two points of a stroke, in ball radii
const MOST_POINTS = 1000;  // of a stroke

export class FloorGestures {
  // `placeAt(event)`: the place of the floor that is visible there, or null. `on`: click(place or null),
  // stroke(points), drawn(points) and armed(whether the next drag draws); points are [x, y].
  constructor(scene, placeAt, on) {
    Object.assign(this, {scene, placeAt, on});
    this.canvas = scene.renderer.domElement;
    this.pointers = new Set();
    this.press = null;   // what may become a click
    this.points = null;  // of the stroke under way
    this.draws = false;
    // Before the canvas, on which the view's own controls listen.
    const {box} = scene, listen = (name, hear) => box.addEventListener(name, (event) => hear.call(this, event), true);
    listen("pointerdown", this.down);
    listen("pointermove", this.move);
    listen("pointerup", this.up);
    listen("pointercancel", this.cancel);
    addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      this.end();
      this.arm(false);
    });
  }

  // Whether the next drag draws, with or without the shift key.
  arm(draws) {
    this.draws = draws;
    this.on.armed(draws);
  }

  down(event) {
    if (event.target !== this.canvas) return;
    if (event.isPrimary) this.pointers.clear();  // the end of one before may have been missed
    this.pointers.add(event.pointerId);
    if (this.pointers.size > 1) {  // two fingers move the view
      this.press = null;
      this.end();
      return;
    }
    if (event.button !== 0 || event.ctrlKey || event.metaKey || event.altKey) return;
    const {pointerId: id, clientX: x, clientY: y} = event;
    this.press = {id, x, y};
    if (!event.shiftKey && !this.draws) return;
    this.scene.controls.enabled = false;
    this.canvas.setPointerCapture(id);
    this.points = [];
    this.add(event);
  }

  move(event) {
    if (this.points && this.pointers.has(event.pointerId)) this.add(event);
    const {press} = this;
    if (press?.id !== event.pointerId) return;
    const slop = SLOP_PX[event.pointerType] ?? SLOP_PX.touch;
    if (Math.hypot(event.clientX - press.x, event.clientY - press.y) > slop) this.press = null;
  }

  up(event) {
    if (!this.pointers.delete(event.pointerId)) return;
    const isClick = this.press?.id === event.pointerId, {points} = this;
    this.press = null;
    this.end();
    if (isClick) {
      this.on.click(this.placeAt(event));
    } else if (points?.length) {
      this.arm(false);
      this.on.drawn(points);
    }
  }

  cancel(event) {
    this.pointers.delete(event.pointerId);
    this.press = null;
    this.end();
  }

  add(event) {
    const place = this.placeAt(event), last = this.points.at(-1);
    if (!place || this.points.length >= MOST_POINTS) return;
    if (last && Math.hypot(place.x - last[0], place.y - last[1]) < CLOSEST * this.scene.radius) return;
    this.points.push([place.x, place.y]);
    this.on.stroke(this.points);
  }

  end() {
    if (!this.points) return;
    this.points = null;
    this.scene.controls.enabled = true;
    this.on.stroke([]);
  }
}
