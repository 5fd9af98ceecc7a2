// The hand in the scene: finds what is under the pointer, and drags it.
//
// In this order: a handle of a target, an obstacle, a link of the robot; all else is left
// to the camera, as are drags with Shift, Ctrl or Meta. A drag ends when the pointer is
// released, but also when it is lost or the page is hidden: nothing stays grabbed.
"use strict";

class PlayHand {
  static STILL = {mouse: 2, pen: 3, touch: 5};  // px: a shorter way is no drag

  constructor(play, viewer) {
    Object.assign(this, {play, viewer, grip: null, hover: null});
    const pane = this.pane = viewer.dom_element;
    const on = (type, act) => pane.addEventListener(type, act, {capture: true});
    on("pointerdown", (event) => this.down(event));
    on("pointermove", (event) => this.move(event));
    on("pointerup", (event) => this.up(event));
    for (const type of ["pointercancel", "lostpointercapture"]) {
      on(type, (event) => { if (event.pointerId === this.grip?.pointer) this.end(); });
    }
    on("pointerleave", () => this.setHover(null));
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.end(); });
    addEventListener("blur", () => this.end());
    addEventListener("pagehide", () => this.end());
  }

  down(event) {
    if (this.grip) return PlayHand.keep(event);  // a second finger changes nothing
    const ours = event.isPrimary && event.button === 0
      && !event.shiftKey && !event.ctrlKey && !event.metaKey;
    if (!ours || !this.play.mine || !this.play.ready) return;
    this.viewer.scene.updateMatrixWorld();
    const {clientX: x, clientY: y, pointerType} = event;
    const found = this.find(x, y, pointerType);
    if (!found) return this.play.select(null);
    PlayHand.keep(event);
    this.viewer.controls.enabled = false;
    this.pane.setPointerCapture(event.pointerId);
    this.grip = {...found, pointer: event.pointerId, x, y, moved: false,
                 still: PlayHand.STILL[pointerType] ?? 3};
    if (found.key) this.play.select(found.key);
    this.setHover(found);
  }

  move(event) {
    const {grip} = this;
    const {clientX: x, clientY: y} = event;
    if (!grip) {
      if (event.pointerType !== "touch" && !event.buttons) this.look(x, y, event.pointerType);
      return;
    }
    PlayHand.keep(event);
    if (event.pointerId !== grip.pointer) return;
    this.viewer.controls.enabled = false;  // a new camera has new controls
    if (!grip.moved) {
      if (Math.hypot(x - grip.x, y - grip.y) < grip.still) return;
      grip.moved = true;
      this.play.sight.update();
      grip.drag = this.begin(grip);
    }
    grip.text = grip.drag(x, y) ?? grip.text;
    this.viewer.set_dirty();
  }

  up(event) {
    if (!this.grip) return;
    PlayHand.keep(event);
    if (event.pointerId !== this.grip.pointer) return;
    this.end();
    if (event.pointerType !== "touch") {
      this.look(event.clientX, event.clientY, event.pointerType);
    }
  }

  // End the drag; what it moved is told that it is free. Silent if another page steers.
  end(silent = false) {
    const {grip, play} = this;
    if (!grip) return;
    this.grip = null;
    this.viewer.controls.enabled = true;
    if (this.pane.hasPointerCapture(grip.pointer)) {
      this.pane.releasePointerCapture(grip.pointer);
    }
    if (grip.moved && !silent) {
      if (grip.gizmo) play.release(grip.gizmo.target.name);
      else if (grip.path) play.letGo();
      else play.outbox.flush();
    }
    play.pull = null;
    this.setHover(null);
  }

  // What a grip does with the pointer, from its first move on.
  begin(grip) {
    const {play} = this;
    const {sight} = play;
    if (grip.gizmo) {
      const drag = grip.gizmo.grab(grip.handle, sight, grip.x, grip.y);
      return (x, y) => {
        const text = drag(x, y);
        if (text !== null) play.moveTarget(grip.gizmo);
        return text;
      };
    }
    const from = grip.path ? grip.point.clone() : grip.obstacle.at.clone();
    const place = Drags.plane(sight, from, sight.back.clone(), grip.x, grip.y);
    return (x, y) => {
      const to = place(x, y);
      if (!to) return null;
      if (grip.path) play.pullLink(grip, to);
      else play.moveObstacle(grip.obstacle, to);
      return grip.path ? "" : Gizmo.way(from, to);
    };
  }

  find(x, y, pointer) {
    const {play} = this;
    const sight = play.sight.update();
    let best = null;
    for (const gizmo of play.gizmos.values()) {
      const found = gizmo.find(sight, x, y, pointer);
      if (found && !(best && best.gap <= found.gap)) best = found;
    }
    if (best) return {...best, key: PlayHand.targetKey(best.gizmo.target.name)};
    return this.findObstacle(x, y, pointer) ?? this.findLink(x, y);
  }

  findObstacle(x, y, pointer) {
    const {sight, obstacles} = this.play;
    let best = null;
    for (const obstacle of obstacles.values()) {
      const {ahead, ...center} = sight.project(obstacle.at);
      const radius = Math.max(obstacle.radius / sight.pixel(obstacle.at),
                              pointer === "touch" ? 22 : 8);
      const depth = sight.depth(obstacle.at);
      if (!ahead || Math.hypot(x - center.x, y - center.y) > radius) continue;
      if (!best || depth < best.depth) {
        best = {obstacle, depth, key: PlayHand.obstacleKey(obstacle.name)};
      }
    }
    return best;
  }

  // The link of the robot under a pixel. Joint 0 is the world: what is fixed to it cannot
  // be pulled.
  findLink(x, y) {
    const {play, viewer} = this;
    const robot = viewer.scene_tree.children.robot;
    if (!play.setup?.pull || !robot) return null;
    const hits = play.sight.caster(x, y).intersectObject(robot.object, true);
    const first = hits.find(({object}) => PlayHand.isVisible(object));
    const path = first && PlayHand.pathOf(robot, "/robot", first.object);
    if (!path || path.startsWith("/robot/universe")) return null;
    const point = first.point.clone().applyMatrix4(play.sight.toScene);
    const local = node(path).worldToLocal(first.point.clone());
    return {path, point, local};
  }

  // Look what is under a resting pointer, at most once a frame.
  look(x, y, pointer) {
    const waiting = this.looking;
    this.looking = {x, y, pointer};
    if (waiting) return;
    requestAnimationFrame(() => {
      const {x, y, pointer} = this.looking;
      this.looking = null;
      if (this.grip || !this.play.ready) return;
      this.setHover(this.play.mine ? this.find(x, y, pointer) : null);
    });
  }

  setHover(found) {
    const {style} = this.pane;
    style.cursor = this.grip ? "grabbing" : found ? "grab" : "";
    const same = this.hover?.key === found?.key && this.hover?.handle === found?.handle;
    this.hover = found;
    if (!same) this.viewer.set_dirty();
    this.play.showMarks();
  }

  static targetKey(name) { return `target ${name}`; }

  static obstacleKey(name) { return `obstacle ${name}`; }

  // The event is ours: neither the camera nor the browser's gestures get it.
  static keep(event) {
    event.stopImmediatePropagation();
    event.preventDefault();
  }

  static isVisible(object) {
    for (let at = object; at; at = at.parent) if (!at.visible) return false;
    return true;
  }

  // The path of the node that holds an object: the deepest one with a name of its own.
  static pathOf({children, object: own}, path, object) {
    for (const [name, child] of Object.entries(children)) {
      if (name === "<object>") continue;
      const found = PlayHand.pathOf(child, `${path}/${name}`, object);
      if (found) return found;
    }
    for (let at = object; at; at = at.parent) if (at === own) return path;
    return null;
  }
}
