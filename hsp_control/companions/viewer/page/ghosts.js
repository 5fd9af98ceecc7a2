// Translucent copies of the robot in other configurations; see viewer/ghosts.py. They share the
// geometries of the robot that is drawn.
"use strict";

class Ghosts {
  constructor(viewer) { Object.assign(this, {viewer, groups: new Map(), labels: new Map()}); }

  show({ghosts: name, joints, count, poses, text, color, opacity}) {
    const ghosts = this.groups.get(name) ?? [];
    this.groups.set(name, ghosts);
    while (ghosts.length > count) ghosts.pop().removeFromParent();
    while (ghosts.length < count) ghosts.push(this.made(color, opacity));
    ghosts.forEach((ghost, k) => joints.forEach((joint, j) => {
      const part = ghost.getObjectByName(joint), at = 7 * (k * joints.length + j);
      part?.position.fromArray(poses, at);
      part?.quaternion.fromArray(poses, at + 3);
    }));
    this.label(name, count ? text : "", color);
    this.viewer.set_dirty();
  }

  made(color, opacity) {
    const ghost = node("/robot").clone();
    ghost.getObjectByName("universe")?.removeFromParent();  // the parts that do not move
    ghost.name = "ghost";
    makeGhost(ghost, color, opacity);
    node("").add(ghost);
    return ghost;
  }

  // The robot was drawn anew: the ghosts are copies of the old one.
  clear() {
    for (const ghost of [...this.groups.values()].flat()) ghost.removeFromParent();
    this.groups.clear();
  }

  // The label of ghosts stands above the first one's highest joint, or below the title.
  label(name, text, color) {
    const known = this.labels.get(name) ?? make("div", {className: "play-label ghost"});
    if (!this.labels.has(name)) part(".play-overlay").append(known);
    this.labels.set(name, known);
    known.textContent = text;
    known.hidden = !text;
    known.style.setProperty("--color", color);
  }

  // A label that would cover another one stands below it.
  layOut(sight) {
    const placed = [];
    for (const [name, label] of this.labels) {
      const [ghost] = this.groups.get(name) ?? [];
      if (label.hidden || !ghost) continue;
      const points = ghost.children.map(({position}) => sight.project(position.clone()));
      const top = points.reduce((one, other) => (one.y < other.y ? one : other));
      const {right, bottom} = part("#caption h1").getBoundingClientRect();
      const {offsetWidth: width, offsetHeight: height} = label;
      const hides = top.x - width / 2 < right && top.y - 40 - height < bottom;
      let y = hides ? bottom + height + 6 : top.y - 40;
      for (const other of placed) {
        const beside = Math.abs(other.x - top.x) > (other.width + width) / 2;
        if (!beside && Math.abs(other.y - y) < height + 4) y = other.y + height + 4;
      }
      placed.push({x: top.x, y, width});
      PlayOverlay.put(label, top.x, y);
    }
  }
}
