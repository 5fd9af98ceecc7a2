// The handles of the targets: a ball, arrows along the world's axes, rings about the
// target's own axes.
//
// Sizes are in pixels, whatever the distance. Where the robot hides a handle it is drawn
// through it, translucent. A pointer finds handles by its distance from them on the screen,
// as thin things are hard to hit; a finger's reach is larger.
"use strict";

class Gizmo {
  static BALL = 8;           // px, radius
  static ARROW = [17, 78];   // px, its start and its tip
  static RING = 54;          // px, radius
  static REACH = {mouse: {ball: 13, arrow: 8, ring: 7}, touch: {ball: 24, arrow: 22, ring: 22}};
  static COLORS = ["#D55E00", "#009E73", "#0072B2"];  // appearance.AXES
  static BALL_COLOR = "#E69F00";                      // appearance.DESIRED
  static AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

  constructor(target, parent) {
    const {Group, Vector3, Quaternion} = MeshCat.THREE;
    this.target = target;
    this.position = new Vector3();
    this.turn = new Quaternion();
    this.enlarged = this.usual = matchMedia("(pointer: coarse)").matches ? 1.2 : 1;
    this.group = new Group();
    this.rings = new Group();
    this.group.add(this.rings);
    this.parts = [];
    this._build();
    this.setPose(target.pose);
    parent.add(this.group);
  }

  get movable() { return this.target.kind !== "orientation"; }

  // Whether the program follows this coordinate of the target.
  follows(axis) { return this.movable && this.target.axes?.[axis] !== false; }

  setPose([x, y, z, ...turn]) {
    this.position.set(x, y, z);
    if (turn.length === 4) this.turn.fromArray(turn);
  }

  pose() { return [...this.position.toArray(), ...this.turn.toArray()]; }

  // The direction of a handle's axis in the world.
  axis({kind, axis}) {
    const direction = new MeshCat.THREE.Vector3(...Gizmo.AXES[axis]);
    return kind === "ring" ? direction.applyQuaternion(this.turn) : direction;
  }

  // Fit its size to the camera.
  layOut(sight) {
    // In a small picture, as above a phone's open sheet, the handles would hide the robot.
    const room = Math.min(sight.box.height / 450, sight.box.width / 480);
    this.enlarged = this.usual * Math.min(Math.max(room, 0.65), 1);
    this.group.position.copy(this.position);
    this.group.scale.setScalar(sight.pixel(this.position) * this.enlarged);
    this.rings.quaternion.copy(this.turn);
    for (const {handle, meshes} of this.parts) {
      if (handle.kind !== "arrow") continue;
      const shown = this._arrowEnds(handle, sight).long;
      for (const mesh of meshes) mesh.visible = shown;
    }
    this.group.updateMatrixWorld();
  }

  // The handle under a pixel, and its distance on the screen; null if none is in reach.
  find(sight, x, y, pointer) {
    const reach = Gizmo.REACH[pointer === "touch" ? "touch" : "mouse"];
    const center = sight.project(this.position);
    if (!center.ahead) return null;
    let best = null;
    const offer = (handle, distance, thickness) => {
      const gap = Math.max(0, distance - thickness);
      if (distance <= Math.max(reach[handle.kind], thickness) && !(best && best.gap <= gap)) {
        best = {gizmo: this, handle, gap};
      }
    };
    for (const {handle} of this.parts) {
      if (handle.kind === "ball") {
        offer(handle, Math.hypot(x - center.x, y - center.y), Gizmo.BALL * this.enlarged + 4);
      } else if (handle.kind === "arrow") {
        const {start, tip, long} = this._arrowEnds(handle, sight);
        if (long) offer(handle, Gizmo.toSegment(x, y, start, tip), 3);
      } else {
        offer(handle, this._toRing(handle, sight, x, y), 2);
      }
    }
    return best;
  }

  // Start to drag a handle: returns a function from pixels to what it says, after which
  // position and turn are the new ones.
  grab(handle, sight, x, y) {
    const from = this.position.clone(), turn = this.turn.clone();
    const {Quaternion} = MeshCat.THREE;
    const rotate = (axis, angle) => this.turn.premultiply(
      new Quaternion().setFromAxisAngle(axis, angle)).normalize();
    if (handle.kind === "ring") {
      const axis = this.axis(handle);
      const angle = Drags.turn(sight, from, axis, Gizmo.RING * this.enlarged, x, y);
      return (x, y) => {
        const value = angle(x, y);
        if (value === null) return null;
        this.turn.copy(turn);
        rotate(axis, value);
        return `${Gizmo.signed(value * 180 / Math.PI, 1)}°`;
      };
    }
    if (!this.movable) {  // the ball of an orientation rolls under the pointer
      const radius = Gizmo.RING * this.enlarged;
      return (to_x, to_y) => {
        this.turn.copy(turn);
        rotate(sight.up, (to_x - x) / radius);
        rotate(sight.right, (to_y - y) / radius);
        return `${(this.turn.angleTo(turn) * 180 / Math.PI).toFixed(1)}°`;
      };
    }
    const place = handle.kind === "arrow"
      ? Drags.line(sight, from, this.axis(handle), x, y) : this._ballDrag(sight, from, x, y);
    return (x, y) => {
      const to = place(x, y);
      if (!to) return null;
      this.position.copy(to);
      return Gizmo.way(from, to);
    };
  }

  // The ball moves in the picture's plane, or in that of the two coordinates, or along
  // the one coordinate, that the program follows.
  _ballDrag(sight, from, x, y) {
    const {Vector3} = MeshCat.THREE;
    const followed = [0, 1, 2].filter((axis) => this.follows(axis));
    const unit = (axis) => new Vector3(...Gizmo.AXES[axis]);
    if (followed.length === 1) return Drags.line(sight, from, unit(followed[0]), x, y);
    if (followed.length === 2) {
      const normal = unit([0, 1, 2].find((axis) => !this.follows(axis)));
      if (Math.abs(normal.dot(sight.towards(from))) > 0.1) {
        return Drags.plane(sight, from, normal, x, y);
      }
    }
    const free = Drags.plane(sight, from, sight.back.clone(), x, y);
    return (x, y) => {
      const to = free(x, y);
      for (const axis of [0, 1, 2]) {
        if (to && !this.follows(axis)) to.setComponent(axis, from.getComponent(axis));
      }
      return to;
    };
  }

  // Show which handle is under the pointer or dragged, and whether any may be.
  mark(handle, dragged, disabled) {
    const white = new MeshCat.THREE.Color("#FFFFFF");
    for (const {handle: own, meshes, color, faint} of this.parts) {
      const hot = handle === own;
      const strength = disabled ? 0.35 : dragged && !hot ? 0.3 : 1;
      for (const mesh of meshes) {
        const {material} = mesh;
        material.color.set(color);
        if (hot) material.color.lerp(white, dragged ? 0.15 : 0.35);
        material.opacity = strength * (material.depthTest ? 1 : hot ? 0.75 : faint);
        mesh.scale.setScalar(1);
        if (hot && own.kind === "arrow") mesh.scale.set(1.35, 1, 1.35);
        if (hot && own.kind === "ball") mesh.scale.setScalar(1.15);
      }
    }
  }

  dispose() {
    this.group.parent.remove(this.group);
    for (const mesh of this.parts.flatMap(({meshes}) => meshes)) {
      mesh.geometry.dispose();
      mesh.material.dispose();
    }
  }

  // A thing's displacement in words: along an axis with its name.
  static way(from, to) {
    const step = to.clone().sub(from);
    const moved = ["x", "y", "z"].filter((name) => Math.abs(step[name]) > 5e-5);
    return (moved.length ? moved : ["x"])
      .map((name) => `${moved.length ? name + " " : ""}${Gizmo.signed(100 * step[name], 1)}`)
      .join("  ") + " cm";
  }

  static signed(value, digits) {
    const text = Math.abs(value).toFixed(digits);
    return Number(text) === 0 ? text : (value < 0 ? "−" : "+") + text;
  }

  static toSegment(x, y, a, b) {
    const [dx, dy] = [b.x - a.x, b.y - a.y];
    const share = ((x - a.x) * dx + (y - a.y) * dy) / (dx * dx + dy * dy || 1);
    const inside = Math.min(Math.max(share, 0), 1);
    return Math.hypot(x - a.x - inside * dx, y - a.y - inside * dy);
  }

  // The pixels of an arrow's ends; one that points at the eye is too short to be used.
  _arrowEnds(handle, sight) {
    const size = sight.pixel(this.position) * this.enlarged, axis = this.axis(handle);
    const [start, tip] = Gizmo.ARROW.map((length) => sight.project(
      this.position.clone().addScaledVector(axis, length * size)));
    return {start, tip, long: Math.hypot(tip.x - start.x, tip.y - start.y) > 16};
  }

  // The distance from the visible half of a ring.
  _toRing(handle, sight, x, y) {
    const {Vector3} = MeshCat.THREE;
    const size = sight.pixel(this.position) * this.enlarged * Gizmo.RING;
    const axis = this.axis(handle), eye = sight.towards(this.position);
    const [u, v] = [(handle.axis + 1) % 3, (handle.axis + 2) % 3].map((other) =>
      new Vector3(...Gizmo.AXES[other]).applyQuaternion(this.turn));
    const faces = Math.abs(axis.dot(eye)) > 0.95;  // seen as a whole circle
    let closest = Infinity, last = null;
    for (let k = 0; k <= 48; k++) {
      const angle = 2 * Math.PI * k / 48;
      const spoke = u.clone().multiplyScalar(Math.cos(angle)).addScaledVector(v, Math.sin(angle));
      const here = faces || spoke.dot(eye) > -0.08
        ? sight.project(spoke.multiplyScalar(size).add(this.position)) : null;
      if (here && last) closest = Math.min(closest, Gizmo.toSegment(x, y, last, here));
      last = here;
    }
    return closest;
  }

  _build() {
    const {SphereGeometry, CylinderGeometry, TorusGeometry, BackSide} = MeshCat.THREE;
    const {BALL, ARROW: [start, tip], RING} = Gizmo;
    const head = 17;
    this._part({kind: "ball"}, new SphereGeometry(BALL + 2.2, 32, 20), "#FFFFFF", 1004, 0.8);
    // Its rim is the far half of a larger ball, which never hides the ball itself.
    for (const {material} of this.parts[0].meshes) material.side = BackSide;
    this._part(this.parts[0].handle, new SphereGeometry(BALL, 32, 20),
               this.target.color ?? Gizmo.BALL_COLOR, 1005, 0.9);
    for (const axis of [0, 1, 2]) {
      if (!this.follows(axis)) continue;
      const handle = {kind: "arrow", axis}, color = Gizmo.COLORS[axis];
      const turned = (mesh) => {
        if (axis === 0) mesh.rotation.z = -Math.PI / 2;
        if (axis === 2) mesh.rotation.x = Math.PI / 2;
      };
      const shaft = new CylinderGeometry(1.6, 1.6, tip - head - start, 16)
        .translate(0, (tip - head + start) / 2, 0);
      const cone = new CylinderGeometry(0, 5.6, head, 24).translate(0, tip - head / 2, 0);
      this._part(handle, shaft, color, 1001, 0.35, turned);
      this._part(handle, cone, color, 1001, 0.35, turned);
    }
    if (this.target.kind === "position") return;
    this._veil(new SphereGeometry(RING - 2, 40, 24));
    for (const axis of [0, 1, 2]) {
      const turned = (mesh) => {
        if (axis === 0) mesh.rotation.y = Math.PI / 2;
        if (axis === 1) mesh.rotation.x = Math.PI / 2;
      };
      this._part({kind: "ring", axis}, new TorusGeometry(RING, 1.5, 10, 96),
                 Gizmo.COLORS[axis], 1003, 0.22, turned, this.rings);
    }
  }

  // A handle's shape, drawn twice: faint through everything, and solid where it is seen.
  _part(handle, geometry, color, order, faint, turned = () => {}, parent = this.group) {
    const {Mesh, MeshBasicMaterial} = MeshCat.THREE;
    const meshes = [false, true].map((depthTest) => {
      const material = new MeshBasicMaterial({
        color, transparent: true, depthTest, depthWrite: false, toneMapped: false,
        opacity: depthTest ? 1 : faint,
      });
      const mesh = new Mesh(geometry, material);
      mesh.renderOrder = depthTest ? order : order - 20;
      mesh.frustumCulled = false;
      turned(mesh);
      parent.add(mesh);
      return mesh;
    });
    const known = this.parts.find((part) => part.handle === handle && part.color === color);
    if (known) known.meshes.push(...meshes);
    else this.parts.push({handle, meshes, color, faint});
  }

  // An invisible ball inside the rings, which makes their far halves faint.
  _veil(geometry) {
    const {Mesh, MeshBasicMaterial} = MeshCat.THREE;
    const veil = new Mesh(geometry, new MeshBasicMaterial({colorWrite: false, transparent: true}));
    veil.renderOrder = 1002;
    this.group.add(veil);
  }
}
