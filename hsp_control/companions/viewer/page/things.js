// What the scene shows beside Meshcat's objects: trails, ghosts, and the lengths of bars.
"use strict";

// Tint an object and all below it, and make them translucent.
function makeGhost(object, color, opacity) {
  const tint = new MeshCat.THREE.Color(color);
  // Where it coincides with a solid object, it is drawn behind it.
  const behind = {polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8};
  eachMaterial(object, (material) => {
    material.color?.lerp(tint, 0.6);
    Object.assign(material, {opacity, transparent: true, needsUpdate: true, ...behind});
  });
  object.traverse((thing) => { thing.castShadow = false; });
}

// A path in space as a thin tube, because WebGL's lines are one pixel wide. Ring i surrounds
// point i; a part of the path is drawn by its first rings: see `drawRings`.
const SIDES = 8;

function trailGeometry(points, radius) {
  const {BufferGeometry, TubeGeometry} = MeshCat.THREE;
  const count = points.length / 3;
  const geometry = count > 1 ? new TubeGeometry(polyline(points), count - 1, radius, SIDES)
    : new BufferGeometry();
  geometry.userData = {trail: true};
  return geometry;
}

// The curve through points, as three.js asks for it: u from 0 to 1, at point i of n: i / (n - 1).
function polyline(points) {
  const {Curve, Vector3} = MeshCat.THREE;
  const last = points.length / 3 - 1;
  const point = (i) => new Vector3().fromArray(points, 3 * clamp(i, 0, last));
  const curve = new Curve();
  let tangent = new Vector3(1, 0, 0);
  for (let i = 0, step; i <= last; i++) {  // of points that coincide at the start
    step = point(i + 1).sub(point(i - 1));
    if (step.length() > 1e-9) { tangent = step.normalize(); break; }
  }
  curve.getPointAt = (u) => point(Math.round(u * last));
  curve.getTangentAt = (u) => {
    const i = Math.round(u * last), step = point(i + 1).sub(point(i - 1));
    if (step.length() > 1e-9) tangent = step.normalize();
    return tangent.clone();
  };
  return curve;
}

// A trail in one colour, the same in any light. Of a sleeve only the back faces are drawn,
// so that it never hides its content.
function trailMesh({points, radius, color, sleeve}) {
  const {Mesh, MeshBasicMaterial, BackSide, FrontSide} = MeshCat.THREE;
  const material = new MeshBasicMaterial({color, side: sleeve ? BackSide : FrontSide});
  const mesh = new Mesh(trailGeometry(points, radius), material);
  mesh.frustumCulled = false;  // a part of it may be drawn
  return mesh;
}

// Draw only the given number of rings after the first.
function drawRings(object, rings) {
  object.traverse(({geometry}) => {
    if (geometry?.userData.trail) geometry.setDrawRange(0, 6 * SIDES * Math.floor(rings + 1e-6));
  });
}

// Labels beside bars, with their lengths: they follow the bars as the scene moves. A bar has the
// length 1 along z; its node's scale in z is what it shows [m].
class LengthLabels {
  static MOST = 8;  // more would hide the scene: then the shortest bars have labels
  static GAP = 7;  // between a bar and its label [px]

  constructor(viewer) {
    this.viewer = viewer;
    this.paths = new Set();
    this.labels = [];
  }

  // Call it after each drawing.
  update() {
    const bars = this.bars();
    while (this.labels.length < bars.length) {
      this.labels.push(make("div", {className: "length-label"}));
      this.viewer.dom_element.append(this.labels.at(-1));
    }
    this.labels.forEach((label, k) => {
      label.hidden = k >= bars.length;
      if (label.hidden) return;
      const {z} = bars[k].scale, deep = this.collides(bars[k]);
      const text = deep ? `${(100 * z).toFixed(1)} cm deep` : `${z.toFixed(2)} m`;
      label.classList.toggle("deep", deep);
      if (label.textContent !== text) label.textContent = text;
      this.place(label, bars[k]);
    });
  }

  // Whether a bar is in the colour of a collision: palette.COLLISION.
  collides(bar) {
    let deep = false;
    eachMaterial(bar, ({color}) => { deep ||= color?.getHex() === 0xD00020; });
    return deep;
  }

  // The visible bars, the shortest first.
  bars() {
    const bars = [];
    for (const path of this.paths) {
      const {object, children} = findNode(this.viewer, path) ?? {};
      const drawn = children?.["<object>"]?.object;
      if (!drawn) {
        this.paths.delete(path);  // the node was deleted
        continue;
      }
      let seen = drawn.layers.test(this.viewer.camera.layers);
      for (let at = drawn; at; at = at.parent) seen &&= at.visible;
      if (seen) bars.push(object);
    }
    return bars.sort((one, other) => one.scale.z - other.scale.z).slice(0, LengthLabels.MOST);
  }

  // Put a label beside the middle of a bar, so that it does not cover the bar.
  place(label, bar) {
    const {clientWidth, clientHeight} = this.viewer.dom_element;
    const seen = (z) => {
      const point = new MeshCat.THREE.Vector3(0, 0, z).applyMatrix4(bar.matrixWorld);
      point.project(this.viewer.camera);
      return [(point.x + 1) / 2 * clientWidth, (1 - point.y) / 2 * clientHeight, point.z];
    };
    const [x0, y0] = seen(0), [x1, y1] = seen(1), [x, y, depth] = seen(0.5);
    if (Math.abs(depth) > 1) label.hidden = true;  // behind the camera
    const length = Math.hypot(x1 - x0, y1 - y0) || 1;
    // Normal to the bar, and to the right, or up if the bar is level.
    let across = [(y0 - y1) / length, (x1 - x0) / length];
    if (across[0] < -1e-3 || (across[0] < 1e-3 && across[1] > 0)) across = across.map((c) => -c);
    const {offsetWidth, offsetHeight} = label;
    const away = LengthLabels.GAP + Math.abs(across[0]) * offsetWidth / 2
      + Math.abs(across[1]) * offsetHeight / 2;
    const left = x + away * across[0] - offsetWidth / 2;
    const top = y + away * across[1] - offsetHeight / 2;
    // Whole pixels: else the same time may give another image.
    label.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
  }
}
