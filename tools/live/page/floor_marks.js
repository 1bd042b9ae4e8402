// Plans, wishes and strokes, flat on the floor: the scenario's plan, the course in force, the place that a
// course is planned to, and the stroke under the pointer.
import {paintPoint, pathWidth, placeEdges, ribbonGeometry, ribbonMesh} from "ballast/path.js";
import {color} from "ballast/theme.js";
import * as THREE from "three";

const MOST_POINTS = 2000;
// In ball radii:
const DASH = 0.35, GAP = 0.25;  // of a planned path
const DOT = 0.08, DOT_GAP = 0.16;
const MARK = 0.16;  // half the size of the mark at a goal
const CIRCLE = 32;  // corners of a round mark

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

// A ring of this mean radius. It is a disc where half its width is that radius.
function ring([x, y], radius, half, z) {
  const points = [];
  for (let k = 0; k <= CIRCLE; ++k) {
    const angle = (2 * Math.PI * k) / CIRCLE;
    points.push([x + radius * Math.cos(angle), y + radius * Math.sin(angle)]);
  }
  return polyline(points, half, z);
}

// As many points as are drawn, the ends among them.
function thinned(path) {
  const spread = Math.max(1, path.length / MOST_POINTS);
  return path.filter((_, k) => k === path.length - 1 || Math.floor(k / spread) !== Math.floor((k - 1) / spread));
}

export class FloorMarks {
  constructor(radius) {
    this.size = MARK * radius;
    this.half = 0.4 * pathWidth(radius, 0);
    this.z = 0.003 * radius;
    this.radius = radius;
    this.object = new THREE.Group();
    this.layers =
        {plan: new THREE.Group(), course: new THREE.Group(), wish: new THREE.Group(), stroke: new THREE.Group()};
    this.object.add(...Object.values(this.layers));
    this.plan = this.course = this.wish = null;
  }

  // The scenario's plan: {path, goal, via}, or null.
  setPlan(plan) {
    this.plan = plan ?? null;
    const {size, half, z} = this, marks = plan ? this.dashed(plan.path, DASH, GAP) : [];
    if (plan) {
      const [x, y] = plan.goal;
      for (const sign of [-1, 1])
        marks.push(polyline([[x - size, y - sign * size], [x + size, y + sign * size]], 1.3 * half, z));
      for (const [vx, vy] of plan.via) marks.push(polyline([[vx - size / 2, vy], [vx + size / 2, vy]], 0.5 * size, z));
    }
    this.replace("plan", marks);
  }

  // The course in force, {path, to, via}, or null. Its places are solid. The scenario's plan is then history.
  setCourse(course) {
    this.course = course;
    const {size, half, z} = this, marks = course ? this.dashed(course.path, DASH, GAP) : [];
    if (course) {
      marks.push(ring(course.to, 0.35 * size, 0.35 * size, z), ring(course.to, size, half, z));
      for (const place of course.via) marks.push(ring(place, 0.25 * size, 0.25 * size, z));
    }
    this.replace("course", marks);
    this.layers.plan.visible = !course;
  }

  // The place that a course is planned to, {to, via}, or null. Its marks are hollow.
  setWish(wish) {
    this.wish = wish;
    const {size, half, z} = this, marks = wish ? this.dashed([...wish.via, wish.to], DOT, DOT_GAP) : [];
    if (wish) {
      marks.push(ring(wish.to, size, half, z));
      for (const place of wish.via) marks.push(ring(place, 0.5 * size, half, z));
    }
    this.replace("wish", marks);
  }

  // Places [x, y] that have been drawn and not been asked for yet.
  setStroke(points) {
    const {size, half, z} = this;
    this.replace(
        "stroke", points.length > 1 ? [polyline(points, half, z)] : points.map((p) => ring(p, 0.5 * size, half, z)));
  }

  // All places that are marked, [x, y].
  get places() {
    const {plan, course, wish} = this;
    const followed = course ? [...course.path, course.to] : plan ? [...plan.path, plan.goal] : [];
    return wish ? [...followed, ...wish.via, wish.to] : followed;
  }

  dashed(path, on, off) {
    const {radius, half, z} = this, points = thinned(path);
    return points.length > 1 ? dashes(points, on * radius, off * radius).map((dash) => polyline(dash, half, z)) : [];
  }

  replace(name, meshes) {
    const layer = this.layers[name];
    for (const {geometry, material} of layer.children) {
      geometry.dispose();
      material.dispose();
    }
    layer.clear();
    if (meshes.length) layer.add(...meshes);
    this.paintLayer(layer);
  }

  paint() {
    for (const layer of Object.values(this.layers)) this.paintLayer(layer);
  }

  paintLayer(layer) {
    const tint = new THREE.Color().setStyle(color("needed"));
    for (const {geometry} of layer.children) {
      const {color: colors} = geometry.attributes;
      for (let k = 0; k < colors.count / 2; ++k) paintPoint(colors.array, k, tint);
      colors.needsUpdate = true;
    }
  }
}
