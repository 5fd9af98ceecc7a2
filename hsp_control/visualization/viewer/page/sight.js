// What the camera sees: from points in the world to pixels of the page, and back to rays.
//
// All points and directions are in Pinocchio's axes (z up), which are the axes inside
// Meshcat's scene; pixels are those of pointer events (clientX, clientY).
"use strict";

class Sight {
  constructor(viewer) { this.viewer = viewer; }

  // Take over the camera's present place; call it before a series of questions.
  update() {
    const {viewer} = this;
    const {camera, scene} = viewer;
    camera.updateWorldMatrix(true, false);
    this.box = viewer.renderer.domElement.getBoundingClientRect();
    this.toScene = scene.matrixWorld.clone().invert();
    const [right, up, back] = [0, 1, 2].map((column) => this._direction(
      new MeshCat.THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, column)));
    const eye = new MeshCat.THREE.Vector3().setFromMatrixPosition(camera.matrixWorld)
      .applyMatrix4(this.toScene);
    Object.assign(this, {right, up, back, eye});
    return this;
  }

  // A point's pixel, and whether it lies in front of the camera.
  project(point) {
    const {camera, scene} = this.viewer;
    const seen = point.clone().applyMatrix4(scene.matrixWorld);
    const ahead = this.depth(point) > camera.near;
    seen.project(camera);
    const {left, top, width, height} = this.box;
    return {x: left + (1 + seen.x) / 2 * width, y: top + (1 - seen.y) / 2 * height, ahead};
  }

  depth(point) { return this.eye.clone().sub(point).dot(this.back); }

  // The length at a point that covers one pixel [m].
  pixel(point) {
    const {fov} = this.viewer.camera;
    return Math.max(this.depth(point), 1e-6) * 2 * Math.tan(fov * Math.PI / 360)
      / this.box.height;
  }

  // The direction from a point to the eye.
  towards(point) { return this.eye.clone().sub(point).normalize(); }

  // A raycaster of three.js through a pixel, in three.js's own axes.
  caster(x, y) {
    const {left, top, width, height} = this.box;
    const caster = new MeshCat.THREE.Raycaster();
    caster.setFromCamera({x: 2 * (x - left) / width - 1, y: 1 - 2 * (y - top) / height},
                         this.viewer.camera);
    return caster;
  }

  // The ray through a pixel.
  ray(x, y) {
    const {origin, direction} = this.caster(x, y).ray;
    return {origin: origin.clone().applyMatrix4(this.toScene),
            direction: this._direction(direction.clone())};
  }

  _direction(vector) { return vector.transformDirection(this.toScene); }
}
