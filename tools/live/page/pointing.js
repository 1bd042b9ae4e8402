// Which place of the floor the pointer is at.
import * as THREE from "three";

export class Pointing {
  // Writes the place under the pointer into `text` while it is over the scene's canvas, and what a click would do
  // there, hint().
  constructor(scene, text, hint) {
    this.scene = scene;
    this.ray = new THREE.Raycaster();
    this.floor = new THREE.Plane(new THREE.Vector3(0, 0, 1), 0);
    const canvas = scene.renderer.domElement;
    canvas.addEventListener("pointermove", (event) => {
      const place = event.pointerType === "mouse" && !event.buttons ? this.placeAt(event) : null;
      text.textContent = place ? `x ${place.x.toFixed(3)} m, y ${place.y.toFixed(3)} m${hint()}` : "";
    });
    canvas.addEventListener("pointerleave", () => (text.textContent = ""));
  }

  // The place of the floor at a pointer, or null above the horizon.
  placeAt({clientX, clientY}) {
    const {left, top, width, height} = this.scene.renderer.domElement.getBoundingClientRect();
    const at = new THREE.Vector2((2 * (clientX - left)) / width - 1, 1 - (2 * (clientY - top)) / height);
    this.ray.setFromCamera(at, this.scene.camera);
    return this.ray.ray.intersectPlane(this.floor, new THREE.Vector3());
  }

  // The same, or null where a ball hides the floor.
  visiblePlaceAt(event) {
    const place = this.placeAt(event), center = new THREE.Vector3();
    if (!place) return null;
    const hides = ({body, radius}) => this.ray.ray.distanceSqToPoint(body.getWorldPosition(center)) < radius * radius;
    return this.scene.robots.some(hides) ? null : place;
  }
}
