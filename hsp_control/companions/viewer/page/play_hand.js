// Pointers and keys in the scene of `hsp play`: the things under them, and their motion.
"use strict";

// The hand finds, in this order: a handle, an obstacle, a link of the robot; all else is left to the
// camera, as are drags with Shift, Ctrl or Meta.
class PlayHand {
  constructor(play, viewer) {
    Object.assign(this, {play, viewer, grip: null, hover: null, pane: viewer.dom_element});
    const first = {capture: true}, {pane} = this;
    on(pane, "pointerdown", (event) => this.down(event), first);
    on(pane, "pointermove", (event) => this.move(event), first);
    on(pane, "pointerup", (event) => this.up(event), first);
    on(pane, "pointercancel lostpointercapture",
       ({pointerId}) => { if (pointerId === this.grip?.pointer) this.end(); }, first);
    on(pane, "pointerleave", () => this.setHover(null), first);
    whenAway(() => this.end());
  }

  down(event) {
    if (this.grip) return PlayHand.keep(event);  // a second finger changes nothing
    const {clientX: x, clientY: y, pointerType, pointerId} = event, {play} = this;
    const ours = event.isPrimary && event.button === 0
      && !event.shiftKey && !event.ctrlKey && !event.metaKey;
    if (!ours || !play.mine || !play.ready) return;
    this.viewer.scene.updateMatrixWorld();
    const found = this.find(x, y, pointerType);
    if (!found) return play.select(null);
    PlayHand.keep(event);
    this.viewer.controls.enabled = false;
    this.pane.setPointerCapture(pointerId);
    const still = pointerType === "touch" ? 5 : 2;  // px: a shorter way is no drag
    this.grip = {...found, pointer: pointerId, x, y, moved: false, still};
    if (found.key) play.select(found.key);
    this.setHover(found);
  }

  move(event) {
    const {grip} = this, {clientX: x, clientY: y, pointerType} = event;
    if (!grip) {
      if (pointerType !== "touch" && !event.buttons) this.look(x, y, pointerType);
      return;
    }
    PlayHand.keep(event);
    if (event.pointerId !== grip.pointer) return;
    this.viewer.controls.enabled = false;  // a new camera has new controls
    if (!grip.moved) {
      if (Math.hypot(x - grip.x, y - grip.y) < grip.still) return;
      this.play.sight.update();
      Object.assign(grip, {moved: true, drag: this.begin(grip)});
    }
    grip.text = grip.drag(x, y) ?? grip.text;
    this.viewer.set_dirty();
  }

  up(event) {
    if (!this.grip) return;
    PlayHand.keep(event);
    if (event.pointerId !== this.grip.pointer) return;
    this.end();
    if (event.pointerType !== "touch") this.look(event.clientX, event.clientY, event.pointerType);
  }

  // End the drag, and release in the program the thing that it moved; not if another page steers (`silent`).
  end(silent = false) {
    const {grip, play, pane} = this;
    if (!grip) return;
    this.grip = null;
    this.viewer.controls.enabled = true;
    if (pane.hasPointerCapture(grip.pointer)) pane.releasePointerCapture(grip.pointer);
    if (grip.moved && !silent) {
      if (grip.gizmo) play.release(grip.gizmo);
      else play.letGo();
    }
    play.pull = null;
    this.setHover(null);
  }

  begin({gizmo, handle, point, x, y, ...link}) {
    const {play} = this, {sight} = play;
    const drag = gizmo ? gizmo.grab(handle, sight, x, y)
      : sight.inPlane(point.clone(), sight.back.clone(), x, y);
    return (x, y) => {
      const found = drag(x, y);
      if (found === null) return null;
      if (gizmo) play.move(gizmo);
      else play.pullLink({...link, point}, found);
      return gizmo ? found : "";
    };
  }

  // The movable thing under a pixel; nothing while one looks back.
  find(x, y, pointer) {
    if (this.play.bar.past.looking) return null;
    const {gizmos} = this.play, sight = this.play.sight.update();
    const found = [...gizmos].map(([key, gizmo]) => ({key, ...gizmo.find(sight, x, y, pointer)}));
    const [best] = found.filter(({gap}) => gap >= 0).sort((one, other) => one.gap - other.gap);
    return best ?? this.findLink(x, y);
  }

  // The link of the robot under a pixel. Links fixed to joint 0, the world, cannot be pulled.
  findLink(x, y) {
    const {setup, sight} = this.play, robot = this.viewer.scene_tree.children.robot;
    if (!setup?.pull || !robot) return null;
    const first = sight.caster(x, y).intersectObject(robot.object, true)
      .find(({object}) => isShown(object));
    const path = first && PlayHand.pathOf(first.object);
    if (!path || path.startsWith("/robot/universe")) return null;
    return {path, point: first.point.clone().applyMatrix4(sight.toScene),
            local: node(path).worldToLocal(first.point.clone())};
  }

  // Find the thing under a pointer without a button, at most once a frame.
  look(...pointer) {
    if (!this.looking) requestAnimationFrame(() => {
      const at = this.looking, {play} = this;
      this.looking = null;
      if (!this.grip && play.ready) this.setHover(play.mine ? this.find(...at) : null);
    });
    this.looking = pointer;
  }

  setHover(found) {
    this.pane.style.cursor = this.grip ? "grabbing" : found ? "grab" : "";
    this.hover = found;
    this.play.showMarks();
  }

  static keep(event) {
    event.stopImmediatePropagation();
    event.preventDefault();
  }

  // The path of the node that holds an object: the object itself has no name.
  static pathOf({name, parent}) {
    return parent ? `${PlayHand.pathOf(parent)}${name && `/${name}`}` : "";
  }
}

// Call a function when the page loses the focus, so that nothing stays held.
function whenAway(act) {
  on(window, "blur pagehide", act);
  on(document, "visibilitychange", () => { if (document.hidden) act(); });
}

// The keys that the panel's foot names; with a clip, those of player_bar.js hold instead. In a live
// loop the space bar is the dead-man's key, if it has one. The arrows follow those of the world's
// horizontal axes that lie nearest to the picture's; a coordinate that the program does not follow is
// left out. An orientation is turned, by 1° (shift: 0.1°).
class PlayKeys {
  static WAYS = {ArrowRight: [1, 0, 0], ArrowLeft: [-1, 0, 0], ArrowUp: [0, 1, 0],
                 ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1]};

  constructor(play) {
    this.play = play;
    this.moving = new Map();  // pressed keys -> their motion
    onKey((event) => this.actionOf(event));
    on(window, "keyup", ({key}) => this.up(key));
    whenAway(() => this.releaseAll());
  }

  actionOf({target, key, shiftKey, repeat}) {
    const {play} = this, way = PlayKeys.WAYS[key];
    if (!play.ready || player.loaded) return null;
    const inControl = target.matches?.("input, button, [tabindex]")
      && target.closest(".play-panel, .play-bar, #caption");
    if (inControl && (key === " " && target.type !== "range" || way)) return null;
    if (key === "Escape") return () => this.escape();
    if (/^[1-9]$/.test(key)) {
      const button = [...play.overlay.buttons.values()][key - 1];
      return button && (() => button.focus());
    }
    if (way) return play.selected && (() => this.move(key, way, shiftKey));
    if (repeat && key !== ".") return null;
    if (key === "m") return () => play.togglePreview();
    if (key === " " && play.holdKey) return () => play.holdKey.set(true);
    return play.simulated && {
      " ": () => play.toggle(), ".": () => play.act("step"),
      r: () => play.act("reset"), s: () => play.act("save"), o: () => play.compareNext(),
    }[key];
  }

  escape() {
    const {play} = this;
    if (play.hand.grip) return play.hand.end();
    this.releaseAll();
    if (document.activeElement?.closest(".play-handles")) document.activeElement.blur();
    play.select(null);
  }

  move(key, way, fine) {
    const {play} = this, gizmo = play.gizmos.get(play.selected);
    if (!play.mine || !gizmo || play.hand.grip || play.bar.past.looking) return;
    play.sight.update();
    if (!gizmo.movable) {
      this.turn(gizmo, way, (fine ? 0.1 : 1) * Math.PI / 180);
    } else {
      const step = this.axis(way, gizmo)?.multiplyScalar(fine ? 0.001 : 0.01);
      if (!step) return;
      gizmo.position.add(step);
    }
    play.move(gizmo);
    this.moving.set(key, gizmo);
  }

  // The world's axis for a key, with its sign: x or y by the picture, z for page up and down.
  axis([across, along, up], gizmo) {
    const {right, up: above} = this.play.sight;
    const ahead = new MeshCat.THREE.Vector3(0, 0, above.z < -0.5 ? -1 : 1).cross(right);
    const sideways = Math.abs(right.x) >= Math.abs(right.y) ? 0 : 1, other = 1 - sideways;
    const [axis, sign] = across ? [sideways, across * Math.sign(right.getComponent(sideways))]
      : along && gizmo.follows(other) ? [other, along * Math.sign(ahead.getComponent(other))]
        : [2, up || along];
    return gizmo.follows(axis) ? gizmo.axes[axis].clone().multiplyScalar(sign) : null;
  }

  turn(gizmo, [across, along, up], angle) {
    const {right, up: above, back} = this.play.sight;
    gizmo.rotate(across ? above : along ? right : back, (across || -along || up) * angle);
  }

  up(key) {
    if (key === " ") this.play.holdKey?.set(false);
    const gizmo = this.moving.get(key);
    this.moving.delete(key);
    if (gizmo && ![...this.moving.values()].includes(gizmo)) this.play.release(gizmo);
  }

  releaseAll() { for (const key of [...this.moving.keys()]) this.up(key); }
}
