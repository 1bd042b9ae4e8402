// The way driven so far, as a ribbon that grows in a bounded number of points, and the planned one under it.
import {paintPoint, pathTints, pathWidth, placeEdges, ribbonGeometry, ribbonMesh} from "ballast/path.js";
import {color} from "ballast/theme.js";
import * as THREE from "three";

const MOST_POINTS = 2000;
const DASH = 0.35, GAP = 0.25;  // of the planned path, in ball radii
const MARK = 0.16;              // half the size of the mark at the goal, in ball radii

// The stretches of a line of [x, y] that are drawn if it is dashed.
function dashes(points, on, off) {
  const found = [];
  let current = [points[0]], left = on, drawn = true;
  for (let k = 1; k < points.length; ++k) {
    let [x, y] = points[k - 1];
    const [toX, toY] = points[k];
    for (let length = Math.hypot(toX - x, toY - y); length > 0;) {
      const part = Math.min(left / length, 1);
      [x, y] = [x + part * (toX - x), y + part * (toY - y)];
      if (drawn) current.push([x, y]);
      left -= part * length;
      length -= part * length;
      if (left > 1e-12) continue;
      if (drawn && current.length > 1) found.push(current);
      drawn = !drawn;
      left = drawn ? on : off;
      current = [[x, y]];
    }
  }
  if (drawn && current.length > 1) found.push(current);
  return found;
}

function polyline(points, half, z) {
  const geometry = ribbonGeometry(points.length), places = geometry.attributes.position.array;
  points.forEach(
      (point, k) => placeEdges(
          places, k, points[Math.max(k - 1, 0)], point, points[Math.min(k + 1, points.length - 1)], half, z));
  return ribbonMesh(geometry);
}

// The planned path, its goal and its places on the way.
class Planned {
  constructor({path, goal, via}, radius) {
    this.object = new THREE.Group();
    const half = 0.4 * pathWidth(radius, 0), z = 0.003 * radius, size = MARK * radius;
    const spread = Math.max(1, path.length / MOST_POINTS);
    const points =
        path.filter((point, k) => k === path.length - 1 || Math.floor(k / spread) !== Math.floor((k - 1) / spread));
    if (points.length > 1)
      for (const dash of dashes(points, DASH * radius, GAP * radius)) this.object.add(polyline(dash, half, z));
    const [x, y] = goal;
    for (const sign of [-1, 1])
      this.object.add(polyline([[x - size, y - sign * size], [x + size, y + sign * size]], 1.3 * half, z));
    for (const [vx, vy] of via) this.object.add(polyline([[vx - size / 2, vy], [vx + size / 2, vy]], 0.5 * size, z));
  }

  paint() {
    const tint = new THREE.Color().setStyle(color("needed"));
    for (const {geometry} of this.object.children) {
      const {color: colors} = geometry.attributes;
      for (let k = 0; k < colors.count / 2; ++k) paintPoint(colors.array, k, tint);
      colors.needsUpdate = true;
    }
  }
}

export class LivePath {
  constructor({radius, described, detail}) {
    Object.assign(this, {radius, plan: described.plan});
    this.least = this.step = detail.path * radius;
    this.points = [];  // [x, y, regime]
    this.geometry = ribbonGeometry(MOST_POINTS + 1);
    for (const attribute of Object.values(this.geometry.attributes)) attribute.setUsage(THREE.DynamicDrawUsage);
    this.geometry.setDrawRange(0, 0);
    this.object = new THREE.Group().add(ribbonMesh(this.geometry));
    this.planned = described.plan ? new Planned(described.plan, radius) : null;
    if (this.planned) this.object.add(this.planned.object);
    this.extent = new THREE.Box3();
    this.paint();
  }

  // What a camera that shows the path has to show.
  get bounds() {
    const bounds = this.extent.clone();
    const {plan} = this;
    for (const [x, y] of plan?.path ?? []) bounds.expandByPoint(new THREE.Vector3(x, y, 0));
    return bounds.isEmpty() ? bounds.expandByPoint(new THREE.Vector3()) : bounds;
  }

  paint() {
    this.tints = pathTints("path");
    this.planned?.paint();
    this.rewrite();
  }

  // Begins with these points, [x, y, regime].
  replace(points) {
    this.points = [];
    this.step = this.least;
    this.extent.makeEmpty();
    for (const point of points) this.keep(point);
    this.rewrite();
  }

  // A place of the ball, which is kept if it is far enough from the last.
  add(x, y, regime) {
    const last = this.points.at(-1);
    if (last && last[2] === regime && Math.hypot(x - last[0], y - last[1]) < this.step) return;
    const before = this.points.length, {half} = this;
    this.keep([x, y, regime]);
    if (this.points.length <= before || this.half !== half)
      this.rewrite();
    else
      this.write(before);
  }

  keep(point) {
    this.points.push(point);
    this.extent.expandByPoint(new THREE.Vector3(point[0], point[1], 0));
    if (this.points.length <= MOST_POINTS) return;
    this.points = this.points.filter((_, k) => k % 2 === 0);
    this.step *= 2;
  }

  get half() {
    // In steps, so that the whole ribbon is seldom written anew.
    const extent = this.extent.isEmpty() ? 0 : this.extent.getSize(new THREE.Vector3()).length();
    return 0.5 * pathWidth(this.radius, extent > 0 ? 2 ** Math.floor(Math.log2(extent)) : 0);
  }

  // Writes point k, and the edges of the one before, whose direction it changes.
  write(k, {half} = this) {
    const {position, color: colors} = this.geometry.attributes, {points} = this, z = 0.005 * this.radius;
    for (const at of [k - 1, k]) {
      if (at < 0) continue;
      placeEdges(position.array, at, points[Math.max(at - 1, 0)], points[at], points[Math.min(at + 1, k)], half, z);
      paintPoint(colors.array, at, this.tints[points[at][2]] ?? this.tints[0]);
    }
    position.needsUpdate = colors.needsUpdate = true;
  }

  rewrite() {
    const {half} = this;
    this.points.forEach((_, k) => this.write(k, {half}));
  }

  // The ribbon ends under the ball.
  show(row, x, y) {
    const count = this.points.length;
    if (!count) return;
    const {position, color: colors} = this.geometry.attributes, last = this.points[count - 1];
    placeEdges(position.array, count, last, [x, y], [x, y], this.half, 0.005 * this.radius);
    if (x === last[0] && y === last[1]) position.array.copyWithin(6 * count, 6 * count - 6, 6 * count);
    colors.array.copyWithin(6 * count, 6 * count - 6, 6 * count);
    position.needsUpdate = colors.needsUpdate = true;
    this.geometry.setDrawRange(0, 6 * count);
  }
}
