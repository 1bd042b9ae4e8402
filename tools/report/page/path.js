// The path of a ball on the floor, coloured by regime. It is a ribbon, since lines are one pixel wide in WebGL.
//
// A path has `object`, `bounds` (a Box3), paint(), and show(row, x, y): the present sample and place.
import {color} from "ballast/theme.js";
import * as THREE from "three";

const WIDTH = 0.056;      // least width in ball radii
const OF_EXTENT = 0.004;  // least width as a fraction of the path's extent, so that a long one is visible
const POINTS = 3000;

// The width of a path in m, for a ball and an extent.
export const pathWidth = (radius, extent) => Math.max(WIDTH * radius, OF_EXTENT * extent);

// Writes the two edges of a ribbon at a point between its neighbours, each [x, y], as entry k of `places`.
export function placeEdges(places, k, before, [x, y], after, half, z) {
  const [dx, dy] = [after[0] - before[0], after[1] - before[1]], length = Math.hypot(dx, dy) || 1;
  const [across, along] = [(-dy / length) * half, (dx / length) * half];
  places.set([x + across, y + along, z, x - across, y - along, z], 6 * k);
}

// The geometry of a ribbon of `count` points, whose places and colours are still to be written.
export function ribbonGeometry(count) {
  const triangles = [];
  for (let k = 1; k < count; ++k) triangles.push(2 * k - 2, 2 * k - 1, 2 * k, 2 * k - 1, 2 * k + 1, 2 * k);
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6 * count), 3));
  geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(6 * count), 3));
  geometry.setIndex(triangles);
  return geometry;
}

// A ribbon's mesh. It lies flat on the floor, under everything else.
export function ribbonMesh(geometry, look = {}) {
  const material = new THREE.MeshBasicMaterial(
      {vertexColors: true, side: THREE.DoubleSide, depthWrite: false, forceSinglePass: true, ...look});
  const mesh = new THREE.Mesh(geometry, material);
  mesh.renderOrder = -1;
  mesh.frustumCulled = false;
  return mesh;
}

// The colours of a path by regime.
export const pathTints =
    (own) => [own, "friction", "flight-path"].map((name) => new THREE.Color().setStyle(color(name)));

export function paintPoint(colors, k, {r, g, b}) {
  colors.set([r, g, b, r, g, b], 6 * k);
}

// The path of a whole run, faint after the present.
export class RunPath {
  constructor({samples, radius, run, several, detail}) {
    Object.assign(this, {samples, run, several});
    const stride = Math.max(1, Math.floor(samples.rows / POINTS));
    const rows = [];
    for (let row = 0; row < samples.rows; row += stride) rows.push(row);
    if (rows.at(-1) !== samples.rows - 1) rows.push(samples.rows - 1);
    const [x, y] = [samples.get("position_0"), samples.get("position_1")];
    this.bounds = new THREE.Box3();
    const kept = this.rows = [];
    for (const row of rows) {
      this.bounds.expandByPoint(new THREE.Vector3(x[row], y[row], 0));
      const before = kept.at(-1) ?? row;
      if (row === 0 || Math.hypot(x[row] - x[before], y[row] - y[before]) > detail.path * radius) kept.push(row);
    }
    const extent = this.bounds.getSize(new THREE.Vector3()).length();
    const half = pathWidth(radius, extent) * (several ? 0.4 : 0.5), z = (0.004 + 0.002 * run) * radius;
    const geometry = ribbonGeometry(kept.length), places = geometry.attributes.position.array;
    const at = (k) => [x[kept[k]], y[kept[k]]];
    kept.forEach(
        (row, k) =>
            placeEdges(places, k, at(Math.max(k - 1, 0)), at(k), at(Math.min(k + 1, kept.length - 1)), half, z));
    this.gone = ribbonMesh(geometry.clone());
    this.toCome = ribbonMesh(geometry, {transparent: true, opacity: 0.34});
    this.object = new THREE.Group().add(this.toCome, this.gone);
  }

  paint() {
    const tints = pathTints(this.several ? `run-${this.run}` : "path"), regimes = this.samples.get("regime");
    for (const {geometry} of this.object.children) {
      const {color: colors} = geometry.attributes;
      this.rows.forEach((row, k) => paintPoint(colors.array, k, tints[regimes[row]] ?? tints[0]));
      colors.needsUpdate = true;
    }
  }

  show(row) {
    const gone = 6 * Math.max(this.rows.findLastIndex((pathRow) => pathRow <= row), 0);
    this.gone.geometry.setDrawRange(0, gone);
    this.toCome.geometry.setDrawRange(gone, Infinity);
  }
}
