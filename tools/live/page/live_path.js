// The way driven so far, as a ribbon that grows in a bounded number of points, and under it what is planned.
import {FloorMarks} from "ballast/floor_marks.js";
import {paintPoint, pathTints, pathWidth, placeEdges, ribbonGeometry, ribbonMesh} from "ballast/path.js";
import * as THREE from "three";

const MOST_POINTS = 2000;
const LEAST_EXTENT = 8;  // ball radii

export class LivePath {
  constructor({radius, described, detail}) {
    this.radius = radius;
    this.least = this.step = detail.path * radius;
    this.points = [];  // [x, y, regime]
    this.geometry = ribbonGeometry(MOST_POINTS + 1);
    for (const attribute of Object.values(this.geometry.attributes)) attribute.setUsage(THREE.DynamicDrawUsage);
    this.geometry.setDrawRange(0, 0);
    this.object = new THREE.Group().add(ribbonMesh(this.geometry));
    this.marks = new FloorMarks(radius);
    this.marks.setPlan(described.plan);
    this.object.add(this.marks.object);
    this.extent = new THREE.Box3();
    this.paint();
  }

  // A camera that shows the path shows all of this.
  get bounds() {
    const bounds = this.extent.clone();
    for (const [x, y] of this.marks.places) bounds.expandByPoint(new THREE.Vector3(x, y, 0));
    if (bounds.isEmpty()) bounds.expandByPoint(new THREE.Vector3());
    // So much floor is visible for a click, however short the path.
    const around = LEAST_EXTENT * this.radius, {x, y} = bounds.getSize(new THREE.Vector3());
    return bounds.expandByVector(new THREE.Vector3(Math.max(around - x, 0) / 2, Math.max(around - y, 0) / 2, 0));
  }

  paint() {
    this.tints = pathTints("path");
    this.marks.paint();
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
