// One run's ball in the replay: shell, rails, masses, contact force and friction cone. Lengths are in m.
import {RunPath} from "ballast/path.js";
import {color} from "ballast/theme.js";
import * as THREE from "three";

// Lengths in ball radii:
const WEIGHT_ARROW = 1.15;   // arrow of the contact force of a ball at rest
const LONGEST_ARROW = 2.6;   // impacts and jumps are cut off there
const FRICTION_ARROW = 0.8;  // greatest arrow of the greatest friction
const CONE_SLANT = 1.3;
const HEAVIEST_MASS = 0.115;  // radius of the heaviest mass; the others scale with the cube root of their mass
const LEAST_MASS = 0.045;

const NOISE = 1e-9;  // forces below this fraction of the weight are rounding errors of 0
const RAIL_POINTS = 600;
// Numbers of segments of round shapes. With 120 segments, a rail's chords are off its circle by 3e-4 of the radius, a
// tenth of a pixel. `path` is the shortest segment in ball radii, a quarter of the path's width, so that no corner
// shows. Where a processor draws, the cost grows with the number of triangles, however small they are.
const FINE = {
  shell: [64, 40],
  mass: [20, 12],
  rail: [120, 5],
  arrow: [12, 24],
  cone: [64, 4],
  path: 0.015
};
const COARSE = {
  shell: [36, 18],
  mass: [14, 8],
  rail: [72, 3],
  arrow: [6, 10],
  cone: [32, 3],
  path: 0.03
};
const CAGE_PIECES = 48;
const REGIMES = ["rolling", "sliding", "flight"];
const UP = new THREE.Vector3(0, 0, 1);

const paint = (material, name) => material.color.setStyle(color(name));

// The shell's texture: gores and bands that make rolling visible. It has alpha only; the material has the colour.
function shellPattern(fine) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = fine ? [1024, 512] : [512, 256];
  const context = canvas.getContext("2d");
  const gores = 8, bands = 4, width = canvas.width / gores, height = canvas.height / bands;
  for (let i = 0; i < gores; ++i)
    for (let j = 0; j < bands; ++j) {
      context.fillStyle = `rgba(255, 255, 255, ${(i + j) % 2 ? 0.3 : 0.09})`;
      context.fillRect(i * width, j * height, width, height);
    }
  context.strokeStyle = "rgba(255, 255, 255, 0.75)";
  context.lineWidth = canvas.width / 205;
  context.strokeRect(-10, canvas.height / 2, canvas.width + 20, 2 * canvas.height);
  for (const i of [0, 2, 4, 6, 8]) {
    context.beginPath();
    context.moveTo(i * width, 0);
    context.lineTo(i * width, canvas.height);
    context.stroke();
  }
  const texture = new THREE.CanvasTexture(canvas);
  texture.anisotropy = fine ? 8 : 1;
  texture.generateMipmaps = fine;
  if (!fine) texture.minFilter = THREE.LinearFilter;
  return texture;
}

// Brightens the material towards the edge, as glass, in the same pass.
const RIM = `
  float edge = 1.0 - abs(dot(across, view)) * inversesqrt(dot(across, across) * dot(view, view));
  gl_FragColor = mix(gl_FragColor, vec4(rimTint, 1.0), 0.75 * edge * edge * edge);`;

function litShell(map, opacity) {
  const rimTint = {value: new THREE.Color()};
  const material = new THREE.MeshPhongMaterial(
      {map, opacity, shininess: 90, specular: 0x555555, transparent: true, depthWrite: false});
  material.premultipliedAlpha = true;  // RIM mixes premultiplied colours
  material.onBeforeCompile = (shader) => {
    shader.uniforms.rimTint = rimTint;
    shader.vertexShader = "varying vec3 across, view;\n" +
        shader.vertexShader.replace("#include <project_vertex>", `#include <project_vertex>
          across = normalMatrix * normal;
          view = -mvPosition.xyz;`);
    shader.fragmentShader = "uniform vec3 rimTint;\nvarying vec3 across, view;\n" +
        shader.fragmentShader.replace(
            "#include <premultiplied_alpha_fragment>", `#include <premultiplied_alpha_fragment>${RIM}`);
  };
  return {
    material,
    paint(tint) {
      material.color.copy(tint);
      rimTint.value.copy(tint);
    }
  };
}

// A shell without light. three.js' own materials convert colours to linear light and back in every pixel, which is slow
// where a processor draws.
function plainShell(map, opacity, side) {
  const uniforms = {
    map: {value: map},
    opacity: {value: opacity},
    tint: {value: new THREE.Color()},
    rimTint: {value: new THREE.Color()}
  };
  const material = new THREE.ShaderMaterial({
    transparent: true,
    depthWrite: false,
    premultipliedAlpha: true,
    side,
    uniforms,
    vertexShader: `
      varying vec2 place;
      varying vec3 across, view;
      void main() {
        vec4 p = modelViewMatrix * vec4(position, 1.0);
        place = uv;
        across = normalMatrix * normal;
        view = -p.xyz;
        gl_Position = projectionMatrix * p;
      }`,
    fragmentShader: `
      uniform sampler2D map;
      uniform float opacity;
      uniform vec3 tint, rimTint;
      varying vec2 place;
      varying vec3 across, view;
      void main() {
        gl_FragColor = opacity * texture2D(map, place).a * vec4(tint, 1.0);
        ${side === THREE.FrontSide ? RIM : ""}
      }`,
  });
  return {
    material,
    paint(tint) {
      uniforms.tint.value.copy(tint).convertLinearToSRGB();
      uniforms.rimTint.value.copy(tint);
    }
  };
}

// The shell's gores and bands as lines. Where a processor draws, they cost a sixth of the surface.
function cageGeometry(radius) {
  const points = [], circle = (place) => {
    for (let k = 0; k < CAGE_PIECES; ++k)
      for (const end of [k, k + 1]) points.push(place((2 * Math.PI * end) / CAGE_PIECES).multiplyScalar(radius));
  };
  for (let k = 0; k < 4; ++k) {
    const [c, s] = [Math.cos((k * Math.PI) / 4), Math.sin((k * Math.PI) / 4)];
    circle((t) => new THREE.Vector3(Math.cos(t) * c, Math.cos(t) * s, Math.sin(t)));
  }
  for (const latitude of [-Math.PI / 4, 0, Math.PI / 4]) {
    const [c, s] = [Math.cos(latitude), Math.sin(latitude)];
    circle((t) => new THREE.Vector3(c * Math.cos(t), c * Math.sin(t), s));
  }
  return new THREE.BufferGeometry().setFromPoints(points);
}

function shadowTexture() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 128;
  const context = canvas.getContext("2d");
  const gradient = context.createRadialGradient(64, 64, 4, 64, 64, 64);
  gradient.addColorStop(0, "rgba(0, 0, 0, 0.55)");
  gradient.addColorStop(0.55, "rgba(0, 0, 0, 0.18)");
  gradient.addColorStop(1, "rgba(0, 0, 0, 0)");
  context.fillStyle = gradient;
  context.fillRect(0, 0, 128, 128);
  return new THREE.CanvasTexture(canvas);
}

class Arrow {
  constructor(thickness, [sides, tipSides]) {
    this.material = new THREE.MeshLambertMaterial();
    this.shaft = new THREE.Mesh(
        new THREE.CylinderGeometry(thickness, thickness, 1, sides, 1, true).translate(0, 0.5, 0).rotateX(Math.PI / 2),
        this.material);
    this.tip = new THREE.Mesh(
        new THREE.ConeGeometry(2.6 * thickness, 7 * thickness, tipSides)
            .translate(0, -3.5 * thickness, 0)
            .rotateX(Math.PI / 2),
        this.material);
    this.head = 7 * thickness;
    this.object = new THREE.Group().add(this.shaft, this.tip);
  }

  point(vector) {
    const length = vector.length();
    this.object.visible = length > 0.3 * this.head;
    if (!this.object.visible) return;
    this.object.quaternion.setFromUnitVectors(UP, vector.clone().divideScalar(length));
    const head = Math.min(this.head, 0.6 * length);
    this.tip.scale.setScalar(head / this.head);
    this.tip.position.z = length;
    this.shaft.scale.z = length - head;
  }
}

export class Robot {
  // `fine`: with details that are cheap on a graphics card. `makePath(robot)` makes what path.js describes.
  constructor({samples, described, makePath = (robot) => new RunPath(robot)}, run, several, fine) {
    Object.assign(this, {samples, described, run, several, fine});
    this.radius = described.radius;
    this.detail = fine ? FINE : COARSE;
    this.object = new THREE.Group();
    this.body = new THREE.Group();
    this.contact = new THREE.Group();
    this.object.add(this.body, this.contact);
    this.painters = [];
    this.makeShell();
    this.makeMasses();
    this.makeForces();
    this.path = makePath(this);
    this.onPaint(() => this.path.paint());
    this.paint();
    this.update(0);
  }

  onPaint(painter) {
    this.painters.push(painter);
  }

  paint() {
    for (const painter of this.painters) painter();
  }

  makeShell() {
    const r = this.radius;
    const geometry = new THREE.SphereGeometry(r, ...this.detail.shell).rotateX(Math.PI / 2);
    const map = shellPattern(this.fine);
    const opacity = this.several ? 0.4 : 1;  // two shells overlap
    const inside = plainShell(map, 0.55 * opacity, THREE.BackSide);
    const outside = this.fine ? litShell(map, opacity) : plainShell(map, opacity, THREE.FrontSide);
    this.shell = new THREE.Group();
    [[inside, 1], [outside, 5]].forEach(([{material}, order]) => {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.renderOrder = order;
      this.shell.add(mesh);
    });
    this.body.add(this.shell);
    this.surface = [...this.shell.children];
    this.cage = new THREE.LineSegments(cageGeometry(r), new THREE.LineBasicMaterial());
    this.cage.visible = false;
    this.shell.add(this.cage);
    this.onPaint(() => {
      const tint = new THREE.Color().setStyle(color(this.several ? `run-${this.run}` : "shell"));
      inside.paint(tint);
      outside.paint(tint);
      this.cage.material.color.copy(tint).lerp(new THREE.Color().setStyle(color("view")), 0.4);
    });
    this.shadow = new THREE.Mesh(
        new THREE.PlaneGeometry(2.2 * r, 2.2 * r),
        new THREE.MeshBasicMaterial({map: shadowTexture(), transparent: true, depthWrite: false}));
    this.shadow.renderOrder = -2;
    this.object.add(this.shadow);
  }

  // The rail of robot.json, or else the path of the mass.
  railPoints(mass) {
    const rail = this.described.masses[mass].rail;
    if (rail) return {closed: rail.closed, points: rail.points.map((point) => new THREE.Vector3(...point))};
    const {samples} = this, points = [], stride = Math.max(1, Math.floor(samples.rows / RAIL_POINTS));
    for (let row = 0; row < samples.rows; row += stride) {
      const point = new THREE.Vector3(...[0, 1, 2].map((j) => samples.get(`mass_B_${3 * mass + j}`)[row]));
      if (!points.length || point.distanceTo(points.at(-1)) > 0.01 * this.radius) points.push(point);
    }
    return {closed: false, points};
  }

  makeMasses() {
    const r = this.radius, masses = this.described.masses, [rails, railSides] = this.detail.rail;
    const heaviest = Math.max(...masses.map(({mass}) => mass ?? 0));
    this.rails = new THREE.Group();
    this.masses = masses.map(({mass}, i) => {
      const {closed, points} = this.railPoints(i);
      const railMaterial = new THREE.MeshLambertMaterial();
      if (points.length > 1) {
        const curve = new THREE.CatmullRomCurve3(points, closed, "centripetal");
        this.rails.add(
            new THREE.Mesh(new THREE.TubeGeometry(curve, rails, 0.011 * r, railSides, closed), railMaterial));
      }
      const size = heaviest > 0 ? Math.max(HEAVIEST_MASS * Math.cbrt(mass / heaviest), LEAST_MASS) : 0.09;
      const material = new THREE.MeshPhongMaterial({shininess: 70, specular: 0x333333});
      const sphere = new THREE.Mesh(new THREE.SphereGeometry(size * r, ...this.detail.mass), material);
      this.body.add(sphere);
      this.onPaint(() => {
        paint(material, `mass-${i}`);
        paint(railMaterial, `mass-${i}`);
        railMaterial.color.lerp(new THREE.Color().setStyle(color("view")), 0.25);
      });
      return sphere;
    });
    this.body.add(this.rails);
    // The system's centre of mass.
    const center = new THREE.MeshLambertMaterial();
    this.center = new THREE.Mesh(new THREE.OctahedronGeometry(0.055 * r), center);
    this.body.add(this.center);
    this.onPaint(() => paint(center, "text"));
  }

  makeForces() {
    const r = this.radius, {samples, described} = this;
    const inside = described.masses.reduce((sum, {mass}) => sum + (mass ?? 0), described.shell_mass ?? 0);
    const normals = samples.get("normal_force").filter((value) => value > 0).sort();
    const weight = described.gravity && inside ? described.gravity * inside : normals[normals.length >> 1];
    this.forceScale = weight > 0 ? (WEIGHT_ARROW * r) / weight : 0;
    const most = samples.get("static_friction").reduce((least, value) => Math.max(least, value), 0);
    const greatest = most > NOISE * weight ? (FRICTION_ARROW * r) / (most * this.forceScale) : 1;
    this.frictionFactor = described.friction_factor ?? [10, 5, 2].find((factor) => factor <= greatest) ?? 1;
    this.force = new Arrow(0.026 * r, this.detail.arrow);
    this.friction = new Arrow(0.022 * r, this.detail.arrow);
    this.forces = new THREE.Group().add(this.force.object, this.friction.object);
    this.contact.add(this.forces);
    this.cone = new THREE.Group();
    this.contact.add(this.cone);
    this.onPaint(() => {
      paint(this.force.material, "force");
      paint(this.friction.material, "friction");
    });
    const limit = described.static_friction, [coneSides, rimSides] = this.detail.cone;
    if (limit === null || limit <= 0) return;
    const angle = Math.atan(limit), height = CONE_SLANT * r * Math.cos(angle), width = CONE_SLANT * r * Math.sin(angle);
    const geometry =
        new THREE.ConeGeometry(width, height, coneSides, 1, true).translate(0, -height / 2, 0).rotateX(-Math.PI / 2);
    this.coneMaterial = new THREE.MeshBasicMaterial(
        {transparent: true, opacity: 0.17, side: THREE.DoubleSide, depthWrite: false, forceSinglePass: true});
    const ringMaterial = new THREE.MeshBasicMaterial({transparent: true, opacity: 0.8});
    const ring = new THREE.Mesh(
        new THREE.TorusGeometry(width, 0.008 * r, rimSides, coneSides).translate(0, 0, height), ringMaterial);
    const mesh = new THREE.Mesh(geometry, this.coneMaterial);
    mesh.renderOrder = 3;
    ring.renderOrder = 3;
    this.cone.add(mesh, ring);
    this.paintCone =
        (inside) => [this.coneMaterial, ringMaterial].forEach((material) => paint(material, inside ? "margin" : "bad"));
    this.onPaint(() => this.paintCone(this.isInside ?? true));
  }

  // The ball as it is drawn at that time.
  update(time) {
    const {samples, radius} = this, place = samples.placeAt(time), row = place[0];
    const [x, y, height] = samples.vectorAt("position", 3, place);
    const [w, i, j, k] = this.orientation(place);
    this.body.position.set(x, y, radius + height);
    this.body.quaternion.set(i, j, k, w).normalize();
    this.contact.position.set(x, y, 0.01 * radius);
    this.shadow.position.set(x, y, 0.006 * radius);
    this.shadow.material.opacity = 1 / (1 + 3 * Math.max(height, 0) / radius);
    this.shadow.scale.setScalar(1 + 0.5 * Math.max(height, 0) / radius);
    this.masses.forEach(
        (sphere, mass) => sphere.position.set(...[0, 1, 2].map((c) => this.between(`mass_B_${3 * mass + c}`, place))));
    this.center.position.set(...samples.vectorAt("center_of_mass", 3, place));
    this.regime = REGIMES[samples.get("regime")[row]] ?? "unknown";
    this.updateForces(place);
    this.path.show(row, x, y);
  }

  between(name, [row, next, part]) {
    const column = this.samples.get(name);
    return column[row] + part * (column[next] - column[row]);
  }

  // q and -q are the same attitude, so both samples are given the same sign before they are interpolated.
  orientation([row, next, part]) {
    const columns = [0, 1, 2, 3].map((c) => this.samples.get(`orientation_${c}`));
    const sign = columns.reduce((sum, column) => sum + column[row] * column[next], 0) < 0 ? -1 : 1;
    return columns.map((column) => column[row] + part * (sign * column[next] - column[row]));
  }

  updateForces(place) {
    const inContact = this.regime !== "flight";
    this.contact.visible = inContact;
    if (!inContact) return;
    const [fx, fy] = this.samples.vectorAt("friction_force", 2, place), normal = this.between("normal_force", place);
    const force = new THREE.Vector3(fx, fy, normal).multiplyScalar(this.forceScale);
    const friction = new THREE.Vector3(fx, fy, 0).multiplyScalar(this.forceScale * this.frictionFactor);
    this.force.point(force.clampLength(0, LONGEST_ARROW * this.radius));
    this.friction.point(friction.clampLength(0, LONGEST_ARROW * this.radius));
    const margin = this.samples.get("margin")[place[0]];
    const inside = this.regime === "rolling" && !(margin < 0);
    if (this.samples.has("floor_friction")) {  // the cone is that of the floor under the ball
      const wide = this.samples.get("floor_friction")[place[0]] / this.described.static_friction;
      this.cone.scale.set(wide || 1, wide || 1, 1);
    }
    if (inside !== this.isInside) {
      this.isInside = inside;
      this.paintCone?.(inside);
    }
  }

  // Draws the shell as a cage of lines, where its surface would take too long.
  simplify(simple) {
    this.cage.visible = simple;
    for (const mesh of this.surface) mesh.visible = !simple;
  }

  show(what, shown) {
    const parts = {shell: this.shell, rails: this.rails, force: this.forces, cone: this.cone, path: this.path.object};
    if (parts[what]) parts[what].visible = shown;
  }
}
