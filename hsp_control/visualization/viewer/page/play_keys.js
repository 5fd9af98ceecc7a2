// The keys of `hsp play`; with a clip, those of controls.js hold instead.
//
//   tab, 1 … 9    select a target or an obstacle     space   pause, go on
//   ← → ↑ ↓       move it by 1 cm (shift: 1 mm)      .       one step
//   page up/down  the same vertically                r       reset
//   escape        let go, select nothing             s       save
//
// `p` is that of presentation.js. In a live loop the space bar is the dead-man's key, if it
// has one, and there is no pause, step, reset or save.
//
// The arrows follow those of the world's horizontal axes that lie nearest to the picture's;
// a coordinate that the program does not follow is left out. An orientation is turned, by 1°
// (shift: 0.1°).
"use strict";

class PlayKeys {
  constructor(play) {
    this.play = play;
    this.moving = new Map();  // keys that are down -> what they move
    addEventListener("keydown", (event) => this.down(event));
    addEventListener("keyup", ({key}) => this.up(key));
    addEventListener("blur", () => this.releaseAll());
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.releaseAll();
    });
  }

  down(event) {
    const {play} = this;
    const {target, key} = event;
    if (!play.ready || player.loaded || event.ctrlKey || event.metaKey || event.altKey) return;
    if (target.matches?.("select, textarea, input[type=text], input[type=number]")) return;
    // In the panel, its own controls take the arrows and the space key first.
    const inControl = target.matches?.("input, button, [tabindex]")
      && target.closest(".play-panel, .play-bar, #caption");
    if (inControl && (key === " " || key.startsWith("Arrow") || key.startsWith("Page"))) return;
    const action = this.action(event);
    if (!action) return;
    event.preventDefault();
    action();
  }

  action({key, shiftKey, repeat}) {
    const {play} = this;
    if (key === "Escape") return () => this.escape();
    if (/^[1-9]$/.test(key)) {
      const thing = play.things()[key - 1];
      return thing && (() => play.overlay.buttons.get(thing.key)?.focus());
    }
    const way = {
      ArrowRight: [1, 0, 0], ArrowLeft: [-1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0],
      PageUp: [0, 0, 1], PageDown: [0, 0, -1],
    }[key];
    if (way) return play.selected && (() => this.move(key, way, shiftKey));
    if (repeat && key !== ".") return null;
    if (key === " " && play.holdKey) return () => play.holdKey.set(true);
    if (!play.simulated) return null;
    return {
      " ": () => play.toggle(), ".": () => play.act("step"),
      r: () => play.act("reset"), s: () => play.act("save"),
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
    const {play} = this;
    const {selected} = play;
    if (!play.mine || !selected || play.hand.grip) return;
    play.sight.update();
    const gizmo = play.gizmos.get(selected);
    if (gizmo && !gizmo.movable) {
      this.turn(gizmo, way, (fine ? 0.1 : 1) * Math.PI / 180);
    } else {
      const at = gizmo?.position ?? play.obstacles.get(selected).at;
      const {axis, sign} = this.axis(way, gizmo);
      if (axis === null) return;
      at.setComponent(axis, at.getComponent(axis) + sign * (fine ? 0.001 : 0.01));
    }
    if (gizmo) {
      play.moveTarget(gizmo);
      this.moving.set(key, gizmo.target.name);
    } else {
      const obstacle = play.obstacles.get(selected);
      play.moveObstacle(obstacle, obstacle.at);
    }
  }

  // The world's axis for a key: x or y by the picture, z for page up and down.
  axis([across, along, up], gizmo) {
    const {right, up: above} = this.play.sight;
    const follows = (axis) => !gizmo || gizmo.follows(axis);
    if (up) return {axis: follows(2) ? 2 : null, sign: up};
    const first = Math.abs(right.x) >= Math.abs(right.y) ? 0 : 1;
    const sideways = Math.sign(right.getComponent(first)) || 1;
    if (across) return {axis: follows(first) ? first : null, sign: across * sideways};
    const other = 1 - first;
    if (!follows(other)) return {axis: follows(2) ? 2 : null, sign: along};
    // To the right of "away from the viewer" is the picture's right.
    const away = (other === 1 ? 1 : -1) * sideways * (above.z < -0.5 ? -1 : 1);
    return {axis: other, sign: along * away};
  }

  turn(gizmo, [across, along, up], angle) {
    const {right, up: above, back} = this.play.sight;
    const axis = across ? above : along ? right : back;
    const turned = new MeshCat.THREE.Quaternion()
      .setFromAxisAngle(axis, (across || -along || up) * angle);
    gizmo.turn.premultiply(turned).normalize();
  }

  up(key) {
    if (key === " ") this.play.holdKey?.set(false);
    const name = this.moving.get(key);
    if (name === undefined) return;
    this.moving.delete(key);
    if (![...this.moving.values()].includes(name)) this.play.release(name);
  }

  releaseAll() {
    const names = new Set(this.moving.values());
    this.moving.clear();
    for (const name of names) this.play.release(name);
  }
}
