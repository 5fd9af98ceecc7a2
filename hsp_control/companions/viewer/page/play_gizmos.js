// The handles of movable things: of a target a ball, arrows along the world's axes and rings about
// its own; of an obstacle itself, and arrows. A line to the floor shows their height. Sizes are in
// pixels, whatever the distance. Where the robot hides a handle it is drawn through it, translucent. A
// pointer finds handles by its distance from them on the screen; a finger's reach is larger.

class Gizmo {
  static BALL = 8;           // px, radius
  static ARROW = [17, 78];   // px, its start and its tip
  static HEAD = 17;          // px
  static RING = 54;          // px, radius
  static REACH = {mouse: {ball: 13, arrow: 8, ring: 7}, touch: {ball: 24, arrow: 22, ring: 22}};
  static COLORS = ["#D55E00", "#009E73", "#0072B2"];  // those of the axes of targets.py

  constructor(target, viewer) {
    const {Group, Vector3, Quaternion} = MeshCat.THREE;
    Object.assign(this, {target, viewer, position: new Vector3(), turn: new Quaternion(), parts: [],
                         group: new Group(), rings: new Group(), shown: true, lined: false});
    this.key = `${this.noun.toLowerCase()} ${target.name}`;
    this.axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => new Vector3(...axis));
    this.enlarged = this.usual = matchMedia("(pointer: coarse)").matches ? 1.2 : 1;
    this.size = 1e-3;  // m: of a pixel here, enlarged
    this.group.add(this.rings);
    this._build();
    this.setPose(target.pose);
    viewer.scene.add(this.group);
  }

  get noun() { return "Target"; }
  get ball() { return Gizmo.BALL; }
  get movable() { return this.target.kind !== "orientation"; }

  // The message to the program: the name of the thing, and its desired place.
  address() { return {target: this.target.name}; }
  wish() { return {do: "move", ...this.address(), pose: this.pose()}; }

  // Whether the program follows this coordinate of the target.
  follows(axis) { return this.movable && this.target.axes?.[axis] !== false; }

  setPose([x, y, z, ...turn]) {
    this.position.set(x, y, z);
    if (turn.length === 4) this.turn.fromArray(turn);
  }

  pose() { return [...this.position.toArray(), ...this.turn.toArray()]; }

  own(axis) { return this.axes[axis].clone().applyQuaternion(this.turn); }

  rotate(axis, angle) {
    const turn = new MeshCat.THREE.Quaternion().setFromAxisAngle(axis, angle);
    this.turn.premultiply(turn).normalize();
  }

  // Fit its size to the camera: in a small picture, usual handles would hide the robot.
  layOut(sight) {
    const room = Math.min(sight.box.height / 450, sight.box.width / 480);
    this.enlarged = this.usual * clamp(room, 0.65, 1);
    this.size = sight.pixel(this.position) * this.enlarged;
    this.group.position.copy(this.position);
    this.group.scale.setScalar(this.size);
    this.rings.quaternion.copy(this.turn);
    for (const {handle, meshes} of this.parts) {
      if (handle.kind === "line") this._layOutLine(meshes);
      if (handle.kind !== "arrow") continue;
      const visible = this._outline(handle, sight).length > 0;
      for (const mesh of meshes) {
        mesh.visible = visible;  // it begins at the ball's surface
        mesh.position.copy(this.axes[handle.axis]).multiplyScalar(this.ball - Gizmo.BALL);
      }
    }
    this.group.updateMatrixWorld();
  }

  _layOutLine(meshes) {
    const floor = findNode(this.viewer, "/floor/shadow")?.object.position.z ?? 0;
    const below = (this.position.z - floor) / this.size, length = below - this.ball;
    meshes.forEach((mesh, k) => {
      const foot = k > 1;
      mesh.visible = this.lined && length > 0;
      mesh.position.z = foot ? -below : -this.ball;
      mesh.scale.set(...(foot ? [this.ball, 1, this.ball] : [1, Math.max(length, 1e-6), 1]));
    });
  }

  // The handle under a pixel, and its distance on the screen; null if none is in reach.
  find(sight, x, y, pointer) {
    if (!sight.project(this.position).ahead) return null;
    const reach = Gizmo.REACH[pointer === "touch" ? "touch" : "mouse"];
    const thickness = {ball: this.ball * this.enlarged + 4, arrow: 3, ring: 2};
    let best = null;
    for (const {handle} of this.parts) {
      const distance = Gizmo.distance(this._outline(handle, sight), x, y), {kind} = handle;
      const gap = Math.max(0, distance - thickness[kind]);
      const reached = distance <= Math.max(reach[kind], thickness[kind]);
      if (reached && !(best?.gap <= gap)) best = {gizmo: this, handle, gap};
    }
    return best;
  }

  // The pixels of a handle's middle line: of a ring its visible half, and of an arrow that points
  // at the eye none, because it is too short to be used.
  _outline({kind, axis}, sight) {
    const {Vector3} = MeshCat.THREE, eye = sight.towards(this.position);
    const at = (offset) => {
      const {x, y} = sight.project(offset.multiplyScalar(this.size).add(this.position));
      return new Vector3(x, y, 0);
    };
    if (kind === "line") return [];
    if (kind === "ball") return [at(new Vector3())];
    if (kind === "arrow") {
      const beyond = this.ball - Gizmo.BALL, along = this.axes[axis];
      const [start, tip] = Gizmo.ARROW.map((way) => at(along.clone().setLength(way + beyond)));
      return this.shown && start.distanceTo(tip) > 16 ? [start, tip] : [];
    }
    const normal = this.own(axis), faces = Math.abs(normal.dot(eye)) > 0.95;  // a whole circle
    return Array.from({length: 49}, (_, k) => {
      const spoke = this.own((axis + 1) % 3).applyAxisAngle(normal, 2 * Math.PI * k / 48);
      return faces || spoke.dot(eye) > -0.08 ? at(spoke.multiplyScalar(Gizmo.RING)) : null;
    });
  }

  // The distance of a pixel from a line through pixels; null: a gap.
  static distance(line, x, y) {
    const {Line3, Vector3} = MeshCat.THREE, pixel = new Vector3(x, y, 0);
    const nearest = line.map((here, k) => here && line[k - 1]
      ? new Line3(line[k - 1], here).closestPointToPoint(pixel, true, new Vector3()) : here);
    return Math.min(...nearest.map((point) => point?.distanceTo(pixel) ?? Infinity));
  }

  // Drag a handle: returns a function of pixels that moves the gizmo and returns the way as text.
  grab(handle, sight, x, y) {
    const from = this.position.clone(), turn = this.turn.clone(), degrees = 180 / Math.PI;
    const radius = Gizmo.RING * this.enlarged;
    if (handle.kind === "ring") {
      const axis = this.own(handle.axis), angle = sight.about(from, axis, radius, x, y);
      return (x, y) => {
        const value = angle(x, y);
        if (value === null) return null;
        this.turn.copy(turn);
        this.rotate(axis, value);
        return `${Gizmo.signed(value * degrees)}°`;
      };
    }
    if (!this.movable) {  // the ball of an orientation rolls under the pointer
      return (to_x, to_y) => {
        this.turn.copy(turn);
        this.rotate(sight.up, (to_x - x) / radius);
        this.rotate(sight.right, (to_y - y) / radius);
        return `${(this.turn.angleTo(turn) * degrees).toFixed(1)}°`;
      };
    }
    const place = handle.kind === "arrow"
      ? sight.onLine(from, this.axes[handle.axis], x, y) : this._ballDrag(sight, from, x, y);
    return (x, y) => {
      const to = place(x, y);
      if (!to) return null;
      this.position.copy(to);
      return Gizmo.way(from, to);
    };
  }

  // The ball moves in the picture's plane, or along the coordinates that the program follows.
  _ballDrag(sight, from, x, y) {
    const left = [0, 1, 2].filter((axis) => !this.follows(axis));
    if (left.length === 2) return sight.onLine(from, this.axes[3 - left[0] - left[1]], x, y);
    if (left.length === 1 && Math.abs(this.axes[left[0]].dot(sight.towards(from))) > 0.1) {
      return sight.inPlane(from, this.axes[left[0]], x, y);
    }
    const free = sight.inPlane(from, sight.back.clone(), x, y);
    return (x, y) => {
      const to = free(x, y);
      for (const axis of to ? left : []) to.setComponent(axis, from.getComponent(axis));
      return to;
    };
  }

  mark(handle, dragged, disabled, selected) {
    this.lined = Boolean(handle) || selected;
    const white = new MeshCat.THREE.Color("#FFFFFF");
    for (const {handle: own, meshes, color, faint} of this.parts) {
      const hot = handle === own;
      const strength = disabled ? 0.35 : dragged && !hot ? 0.3 : 1;
      for (const {material, scale} of meshes) {
        material.color.set(color);
        if (hot) material.color.lerp(white, dragged ? 0.15 : 0.35);
        material.opacity = strength * (material.depthTest ? 1 : hot ? 0.75 : faint);
        scale.setScalar(hot && own.kind === "ball" ? 1.15 : 1);
        if (hot && own.kind === "arrow") scale.set(1.35, 1, 1.35);  // of a line: see layOut
      }
    }
  }

  dispose() {
    this.group.removeFromParent();
    for (const {geometry, material} of this.parts.flatMap(({meshes}) => meshes)) {
      geometry.dispose();
      material.dispose();
    }
  }

  static way(from, to) {
    const step = to.clone().sub(from);
    const moved = ["x", "y", "z"].filter((name) => Math.abs(step[name]) > 5e-5);
    const ways = moved.map((name) => `${name} ${Gizmo.signed(100 * step[name])}`);
    return `${ways.join("  ") || "0.0"} cm`;
  }

  static signed(value) {
    const text = Math.abs(value).toFixed(1);
    return Number(text) === 0 ? text : (value < 0 ? "−" : "+") + text;
  }

  _build() {
    const {SphereGeometry, CylinderGeometry, RingGeometry, TorusGeometry, DoubleSide, Mesh,
           MeshBasicMaterial} = MeshCat.THREE;
    const {ARROW: [start, tip], HEAD, RING} = Gizmo, quarter = Math.PI / 2;
    const color = this.target.color ?? "#E69F00";  // palette.DESIRED
    this._buildBall(color);
    const down = new CylinderGeometry(0.8, 0.8, 1, 8).translate(0, 0.5, 0);
    const foot = new RingGeometry(0.86, 1, 48).rotateX(quarter);
    this._part({kind: "line"}, [down, foot], color, 1000, 0.3, {x: -quarter, side: DoubleSide});
    const along = [{z: -quarter}, {}, {x: quarter}];  // from y to the three axes
    for (const axis of [0, 1, 2].filter((axis) => this.follows(axis))) {
      const shaft = new CylinderGeometry(1.6, 1.6, tip - HEAD - start, 16)
        .translate(0, (tip - HEAD + start) / 2, 0);
      const cone = new CylinderGeometry(0, 5.6, HEAD, 24).translate(0, tip - HEAD / 2, 0);
      this._part({kind: "arrow", axis}, [shaft, cone], Gizmo.COLORS[axis], 1001, 0.35, along[axis]);
    }
    if (!["orientation", "pose"].includes(this.target.kind)) return;
    // An invisible ball inside the rings, which makes their far halves faint.
    const veil = new Mesh(new SphereGeometry(RING - 2, 40, 24),
                          new MeshBasicMaterial({colorWrite: false, transparent: true}));
    veil.renderOrder = 1002;
    this.group.add(veil);
    const across = [{y: quarter}, {x: quarter}, {}];
    for (const axis of [0, 1, 2]) {
      this._part({kind: "ring", axis}, [new TorusGeometry(RING, 1.5, 10, 96)], Gizmo.COLORS[axis],
                 1003, 0.22, {...across[axis], parent: this.rings});
    }
  }

  // Its rim is the far half of a larger ball, which never hides the ball itself.
  _buildBall(color) {
    const {SphereGeometry, BackSide} = MeshCat.THREE, {BALL} = Gizmo, ball = {kind: "ball"};
    this._part(ball, [new SphereGeometry(BALL + 2.2, 32, 20)], "#FFFFFF", 1004, 0.8, {side: BackSide});
    this._part(ball, [new SphereGeometry(BALL, 32, 20)], color, 1005, 0.9);
  }

  // A handle's shapes, each drawn twice: faint through everything, and solid where it is seen.
  _part(handle, geometries, color, order, faint, {side = 0, parent = this.group, ...turned} = {}) {
    const {Mesh, MeshBasicMaterial} = MeshCat.THREE;
    const meshes = geometries.flatMap((geometry) => [false, true].map((depthTest) => {
      const opacity = depthTest ? 1 : faint, renderOrder = depthTest ? order : order - 20;
      const mesh = new Mesh(geometry, new MeshBasicMaterial(
        {color, side, opacity, transparent: true, depthTest, depthWrite: false, toneMapped: false}));
      Object.assign(mesh, {renderOrder, frustumCulled: false});
      Object.assign(mesh.rotation, turned);
      parent.add(mesh);
      return mesh;
    }));
    this.parts.push({handle, meshes, color, faint});
  }
}

// The handles of an obstacle. The obstacle itself replaces the ball; near the robot in the picture
// it is dragged at the robot's depth. Of several obstacles only the one under the pointer or
// selected has arrows.
class Obstacle extends Gizmo {
  constructor(obstacle, viewer, alone) {
    super({pose: obstacle.position, color: "#D55E00", ...obstacle}, viewer);  // palette.OBSTACLE
    this.alone = alone;
    this.mark(null);
  }

  get noun() { return "Obstacle"; }
  get ball() { return Math.max(this.target.radius / this.size, Gizmo.BALL); }

  address() { return {name: this.target.name}; }

  wish() { return {do: "obstacle", ...this.address(), position: this.position.toArray()}; }

  // After all handles, and the nearest first.
  find(sight, ...pointer) {
    const found = super.find(sight, ...pointer);
    if (found?.handle.kind === "ball") found.gap = 1e6 + sight.depth(this.position);
    return found;
  }

  mark(handle, dragged, disabled, selected) {
    super.mark(handle, dragged, disabled, selected);
    this.shown = this.alone || this.lined;
    this.lined = true;
  }

  _ballDrag(sight, from, x, y) {
    return sight.atRobot(from, findNode(this.viewer, "/robot")?.object, x, y);
  }

  _buildBall() { this.parts.push({handle: {kind: "ball"}, meshes: []}); }
}
