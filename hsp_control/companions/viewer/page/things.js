// Things in the scene beside Meshcat's objects: trails, ghosts, and the lengths of bars.
"use strict";

// Tint an object and all below it, and make them translucent.
function makeGhost(object, color, opacity) {
  const tint = new MeshCat.THREE.Color(color);
  // Where it coincides with a solid object, it is drawn behind it.
  const behind = {polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8};
  object.traverse((thing) => {
    const {material, castShadow} = thing;
    if (!material) return;
    thing.userData.solid = {material, castShadow};
    const ghosts = [material].flat().map((each) => each.clone());
    for (const ghost of ghosts) {
      ghost.color?.lerp(tint, 0.6);
      Object.assign(ghost, {opacity, transparent: true, ...behind});
    }
    Object.assign(thing, {material: Array.isArray(material) ? ghosts : ghosts[0], castShadow: false});
  });
}

function makeSolid(object) { object.traverse((thing) => Object.assign(thing, thing.userData.solid)); }

// A path in space as a thin tube in one colour, the same in any light, because WebGL's lines are
// one pixel wide. Ring i surrounds point i; a part of the path is drawn by its first rings: see
// `drawRings`. Of a sleeve only the back faces are drawn, so that it never hides its content.
const SIDES = 8;

function trailMesh({points, radius, color, sleeve}) {
  const {Mesh, MeshBasicMaterial, BackSide, FrontSide, BufferGeometry, TubeGeometry} = MeshCat.THREE;
  const count = points.length / 3;
  const geometry = count > 1 ? new TubeGeometry(polyline(points), count - 1, radius, SIDES)
    : new BufferGeometry();
  geometry.userData = {trail: true};
  const material = new MeshBasicMaterial({color, side: sleeve ? BackSide : FrontSide});
  const mesh = new Mesh(geometry, material);
  mesh.frustumCulled = false;  // a part of it may be drawn
  return mesh;
}

// The curve through points, as three.js requires it: u from 0 to 1, at point i of n: i / (n - 1).
// Where points coincide its direction is the one before, and at the start the first.
function polyline(points) {
  const {Curve, Vector3} = MeshCat.THREE;
  const last = points.length / 3 - 1;
  const point = (i) => new Vector3().fromArray(points, 3 * clamp(i, 0, last));
  const steps = Array.from({length: last + 1}, (_, i) => point(i + 1).sub(point(i - 1)));
  const moves = (step) => step.length() > 1e-9;
  let tangent = (steps.find(moves) ?? new Vector3(1, 0, 0)).normalize();
  const tangents = steps.map((step) => {
    if (moves(step)) tangent = step.normalize();
    return tangent;
  });
  return Object.assign(new Curve(), {
    getPointAt: (u) => point(Math.round(u * last)),
    getTangentAt: (u) => tangents[Math.round(u * last)].clone(),
  });
}

// Draw only the given number of rings after the first.
function drawRings(object, rings) {
  object.traverse(({geometry}) => {
    if (geometry?.userData.trail) geometry.setDrawRange(0, 6 * SIDES * Math.floor(rings + 1e-6));
  });
}

// Labels beside bars, with their lengths: of each the scale of its node in z [m].
class LengthLabels {
  static MOST = 8;  // more would hide the scene: then the shortest bars have labels

  constructor(viewer) {
    const className = "length-label", length = LengthLabels.MOST;
    const labels = Array.from({length}, () => make("div", {className}));
    Object.assign(this, {viewer, labels, paths: new Set()});
    viewer.dom_element.append(...labels);
  }

  update() {
    const bars = this.bars();
    this.labels.forEach((label, k) => {
      label.hidden = k >= bars.length;
      if (label.hidden) return;
      const {z} = bars[k].scale, {color} = bars[k].getObjectByProperty("isMesh", true).material;
      const deep = color.getHex() === 0xD00020;  // palette.COLLISION
      const text = deep ? `${(100 * z).toFixed(1)} cm deep` : `${z.toFixed(2)} m`;
      label.classList.toggle("deep", deep);
      if (label.textContent !== text) label.textContent = text;
      this.place(label, bars[k]);
    });
  }

  bars() {
    const bars = [];
    for (const path of this.paths) {
      const {object, children} = findNode(this.viewer, path) ?? {};
      const drawn = children?.["<object>"]?.object;
      if (!drawn) this.paths.delete(path);  // the node was deleted
      else if (drawn.layers.test(this.viewer.camera.layers) && isShown(drawn)) bars.push(object);
    }
    return bars.sort((one, other) => one.scale.z - other.scale.z).slice(0, LengthLabels.MOST);
  }

  // Put a label beside the middle of a bar, so that it does not cover the bar.
  place(label, bar) {
    const [start, middle, end] = [0, 0.5, 1].map((z) => pixelOf(
      this.viewer, new MeshCat.THREE.Vector3(0, 0, z).applyMatrix4(bar.matrixWorld)));
    if (Math.abs(middle.z) > 1) label.hidden = true;  // behind the camera
    // Normal to the bar, and to the right, or up if the bar is level.
    const across = new MeshCat.THREE.Vector2(start.y - end.y, end.x - start.x).normalize();
    if (across.x < -1e-3 || (across.x < 1e-3 && across.y > 0)) across.negate();
    const width = label.offsetWidth / 2, height = label.offsetHeight / 2;
    const away = 7 + Math.abs(across.x) * width + Math.abs(across.y) * height;
    const left = middle.x + away * across.x - width, top = middle.y + away * across.y - height;
    // Whole pixels: else the same time may give another image.
    label.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
  }
}

// Whether an object and all that it is in are visible.
function isShown(object) { return !object || (object.visible && isShown(object.parent)); }

// A point of three.js's world in pixels of the picture; z is from -1 to 1 before the camera.
function pixelOf({camera, dom_element: {clientWidth, clientHeight}}, point) {
  const {x, y, z} = point.project(camera);
  return {x: (x + 1) / 2 * clientWidth, y: (1 - y) / 2 * clientHeight, z};
}
