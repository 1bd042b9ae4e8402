// The replay: floor, light, camera, and one ball per run.
import {Resolution} from "ballast/resolution.js";
import {Robot} from "ballast/robot.js";
import {color, onThemeChange} from "ballast/theme.js";
import * as THREE from "three";
import {OrbitControls} from "three/OrbitControls";

const FIELD_OF_VIEW = 34;  // degrees
// Pixels per CSS pixel:
const MOST_PIXELS = 2;
const FIRST_PIXELS_IN_SOFTWARE = 0.5;
const LEAST_PIXELS = 0.35;   // the ball is then 80 pixels wide on a phone, and its rolling is still visible
const STILL_AFTER_MS = 200;  // after this time without a change, all pixels are drawn
const DIRECTION = new THREE.Vector3(-0.62, -1, 0.52).normalize();

// 1, 2 or 5 times a power of ten, at most `value`.
function roundLength(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * ([5, 2, 1].find((factor) => factor * power <= value) ?? 1);
}

// The patches of the floor (of the first run, where two are compared), flat on it, later ones over earlier ones. They
// are drawn before everything but the grid, so that nothing has to be sorted.
function patchMeshes(patches) {
  return patches.map((patch, number) => {
    const shape = new THREE.Shape();
    if (patch.polygon)
      shape.setFromPoints(patch.polygon.map(([x, y]) => new THREE.Vector2(x, y)));
    else
      shape.absarc(...patch.center, patch.radius, 0, 2 * Math.PI);
    const geometry = new THREE.ShapeGeometry(shape, 48);
    const material = new THREE.MeshBasicMaterial({depthTest: false, depthWrite: false, side: THREE.DoubleSide});
    const mesh = new THREE.Mesh(geometry, material);
    mesh.renderOrder = -5 + number / 1000;
    mesh.name = `patch-${patch.kind}`;
    return mesh;
  });
}

// True without a graphics card. The processor then computes every pixel, several times with smooth edges.
function drawsInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const named = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl ? gl.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

// Frees what the graphics card keeps of an object and all in it.
function dispose(object) {
  object.traverse(({geometry, material}) => {
    geometry?.dispose();
    material?.map?.dispose();
    material?.uniforms?.map?.value.dispose();
    material?.dispose();
  });
}

// A grid that fades with the distance from the camera's target. Every fifth line is stronger.
function floorMaterial(patched) {
  return new THREE.ShaderMaterial({
    // It is drawn first, or over the patches. Its colour is multiplied by its opacity already.
    blending: patched ? THREE.CustomBlending : THREE.NoBlending,
    blendSrc: THREE.OneFactor,
    blendDst: THREE.OneMinusSrcAlphaFactor,
    depthTest: false,
    depthWrite: false,
    side: THREE.DoubleSide,
    uniforms: {
      tint: {value: new THREE.Color()},
      spacing: {value: 1},
      middle: {value: new THREE.Vector2()},
      reach: {value: 10}
    },
    vertexShader: `
      varying vec2 place;
      void main() {
        vec4 p = modelMatrix * vec4(position, 1.0);
        place = p.xy;
        gl_Position = projectionMatrix * viewMatrix * p;
      }`,
    fragmentShader: `
      uniform vec3 tint;
      uniform float spacing, reach;
      uniform vec2 middle;
      varying vec2 place;
      float lines(float s, vec2 pixel) {
        vec2 off = abs(fract(place / s - 0.5) - 0.5) * (s / pixel);
        return 1.0 - min(min(off.x, off.y), 1.0);
      }
      void main() {
        vec2 pixel = fwidth(place);
        float far = 1.0 - smoothstep(0.25 * reach, reach, distance(place, middle));
        gl_FragColor = far * max(0.45 * lines(spacing, pixel), 0.95 * lines(5.0 * spacing, pixel)) * vec4(tint, 1.0);
      }`,
  });
}

export class Scene {
  constructor(box, runs, clock, scaleText) {
    this.box = box;
    this.clock = clock;
    this.scaleText = scaleText;
    const fine = this.fine = !drawsInSoftware();
    this.renderer = new THREE.WebGLRenderer({antialias: fine, alpha: true});
    this.renderer.debug.checkShaderErrors = false;  // a check waits for the compiler
    const most = Math.min(devicePixelRatio, MOST_PIXELS);
    this.resolution = fine ? new Resolution(most, most, LEAST_PIXELS, null) :
                             new Resolution(most, FIRST_PIXELS_IN_SOFTWARE, LEAST_PIXELS, true);
    this.robots = [];
    this.setPixelRatio(most);
    this.movedAt = -Infinity;
    const canvas = this.renderer.domElement;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "The ball on its floor, with its masses, the contact force and the path");
    box.prepend(canvas);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(FIELD_OF_VIEW);
    this.camera.up.set(0, 0, 1);
    this.makeLight();
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.maxPolarAngle = 0.495 * Math.PI;
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => (this.dirty = true));
    this.follows = true;
    this.drawn = new THREE.Group();  // all of the runs
    this.scene.add(this.drawn);
    this.setRuns(runs);
    this.resize();
    this.look("ball");
    new ResizeObserver(() => this.resize()).observe(box);
    onThemeChange(() => this.paint());
    clock.onChange((time) => this.showTime(time));
  }

  // Draws these runs instead of those before. The camera keeps its direction.
  setRuns(runs) {
    dispose(this.drawn);
    this.drawn.clear();
    this.robots = runs.map((run, number) => new Robot(run, number, runs.length > 1, this.fine));
    this.radius = Math.max(...this.robots.map(({radius}) => radius));
    for (const {object, path} of this.robots) this.drawn.add(object, path.object);
    this.patches = patchMeshes(runs[0].described.patches ?? []);
    this.floor = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), floorMaterial(this.patches.length > 0));
    this.floor.renderOrder = -3;
    this.drawn.add(this.floor, ...this.patches);
    Object.assign(this.camera, {near: 0.03 * this.radius, far: 4000 * this.radius});
    this.camera.updateProjectionMatrix();
    this.controls.minDistance = 1.3 * this.radius;
    this.controls.maxDistance = 1500 * this.radius;
    this.paint();
    this.setPixelRatio(this.pixelRatio);
  }

  makeLight() {
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8890a0, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(-2, -1, 4);
    this.scene.add(sun);
  }

  // The mean position of the balls.
  get middle() {
    return this.robots.reduce((sum, {body}) => sum.add(body.position), new THREE.Vector3())
        .divideScalar(this.robots.length);
  }

  paint() {
    for (const robot of this.robots) robot.paint();
    this.floor.material.uniforms.tint.value.setStyle(color("floor"));
    for (const {material, name} of this.patches) material.color.setStyle(color(name));
    this.dirty = true;
  }

  show(what, shown) {
    if (what === "follow") {
      this.follows = shown;
      if (shown) this.look("ball", this.camera.position.clone().sub(this.controls.target).normalize());
    }
    for (const robot of this.robots) robot.show(what, shown);
    this.dirty = true;
  }

  showTime(time) {
    const before = this.middle;
    for (const robot of this.robots) robot.update(time);
    if (this.follows) {
      const moved = this.middle.sub(before);
      this.camera.position.add(moved);
      this.controls.target.add(moved);
    }
    this.dirty = true;
  }

  // Points the camera from `direction` at a sphere, at the distance where all of it is visible.
  lookAt(center, size, direction) {
    const upright = THREE.MathUtils.degToRad(FIELD_OF_VIEW) / 2;
    const across = Math.atan(Math.tan(upright) * this.camera.aspect);
    const distance = size / Math.sin(Math.min(upright, across));
    this.controls.target.copy(center);
    this.camera.position.copy(center).addScaledVector(direction, distance);
    this.controls.update();
    this.dirty = true;
  }

  look(at, direction = DIRECTION) {
    const above = new THREE.Vector3(-1e-3, -1e-3, 1).normalize();
    if (at === "ball") {
      const apart = Math.max(...this.robots.map(({body}) => body.position.distanceTo(this.middle)));
      this.lookAt(this.middle, 1.5 * this.radius + Math.min(apart, 6 * this.radius), direction);
      return;
    }
    const bounds = this.robots.reduce((box, {path}) => box.union(path.bounds), new THREE.Box3());
    const center = bounds.getCenter(new THREE.Vector3()).setZ(0.5 * this.radius);
    const size = 0.5 * bounds.getSize(new THREE.Vector3()).length() + 1.4 * this.radius;
    this.lookAt(center, size, at === "top" ? above : direction);
  }

  resize() {
    const {clientWidth: width, clientHeight: height} = this.box;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  setPixelRatio(ratio) {
    this.pixelRatio = ratio;
    this.renderer.setPixelRatio(ratio);
    const simple = !this.fine && ratio < this.resolution.most;
    for (const robot of this.robots) robot.simplify(simple);
    this.renderer.domElement.style.imageRendering = simple ? "pixelated" : "";  // smoothing costs time too
  }

  // Draws if something has changed. Returns whether it did.
  render() {
    const now = performance.now();
    if (this.dirty) this.movedAt = now;
    const {ratio: moving, most: still} = this.resolution;
    const ratio = now - this.movedAt < STILL_AFTER_MS ? moving : still;
    if (!this.dirty && ratio === this.pixelRatio) return false;
    if (ratio !== this.pixelRatio) this.setPixelRatio(ratio);
    this.dirty = false;
    const {target} = this.controls, distance = this.camera.position.distanceTo(target),
          {uniforms} = this.floor.material;
    const spacing = roundLength(Math.max(distance / 9, 0.05 * this.radius));
    if (uniforms.spacing.value !== spacing || !this.scaleText.textContent) {
      uniforms.spacing.value = spacing;
      this.scaleText.textContent = `grid ${Number(spacing.toPrecision(2))} m`;
    }
    uniforms.reach.value = 2.6 * distance;
    uniforms.middle.value.set(target.x, target.y);
    this.floor.position.set(target.x, target.y, 0);
    this.floor.scale.setScalar(5.4 * distance);
    this.renderer.render(this.scene, this.camera);
    return true;
  }
}
