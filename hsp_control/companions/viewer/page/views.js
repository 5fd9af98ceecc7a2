// Views by name: front, side, top, and the tool from near, which the camera then follows. Keys: c shows
// the next one, after the last one the first view again.
"use strict";

class Views {
  constructor(viewer, show) {
    Object.assign(this, {viewer, show, command: null, name: "", tool: null, followed: null});
    const buttons = legend.views.querySelectorAll("button");
    this.buttons = new Map([...buttons].map((button) =>
      [button.dataset.view, onPress(button, () => this.select(button.dataset.view))]));
    onKey(({key, repeat}) => key === "c" && !repeat && this.command && (() => {
      const names = ["", ...this.buttons.keys()];
      this.select(names[(names.indexOf(this.name) + 1) % names.length]);
    }));
  }

  // The program has placed the camera: the first view, or one that a configuration names.
  begin(command) {
    this.command = command;
    this.select(command.view ?? "");
  }

  select(name) {
    this.name = name;
    for (const [each, button] of this.buttons) button.ariaPressed = each === name;
    this.place();
  }

  // Place the camera, also for another size of the window.
  place() {
    const {command, name, viewer} = this, {views, tool, tool_point, ...first} = command;
    this.followed = name === "tool" ? this.toolPlace() : null;
    if (!name) this.show(first);
    else if (!this.followed) this.show({...first, eye: undefined, ...views[name] ?? views.front});
    else {
      const target = [this.followed.x, -this.followed.z, this.followed.y];
      const near = {points: [target], radius: 0.3 * command.size, target};
      this.show({...first, eye: undefined, ...views.tool, ...near});
    }
    viewer.set_dirty();
  }

  // See these points, too, in Pinocchio's axes, and keep seeing them; not while the tool is followed.
  // Things farther away than three times the scene's size stay outside.
  widen(points) {
    const {command, name} = this, known = command.points.map((point) => vector(point));
    if (!untouched() || name === "tool") return;
    const center = vector(command.target), apart = 0.03 * command.size;
    const added = points.map((point) => point.toArray()).filter((point) => {
      const place = vector(point);
      return place.distanceTo(center) < 3 * command.size
        && known.every((other) => other.distanceTo(place) > apart);
    });
    if (!added.length) return;
    this.command = {...command, points: [...command.points, ...added], widened: true};
    this.place();
  }

  // Where the tool is, in three.js's axes.
  toolPlace() {
    const {tool, tool_point: point} = this.command, object = findNode(this.viewer, tool)?.object;
    object?.updateWorldMatrix(true, false);
    return object ? object.localToWorld(new MeshCat.THREE.Vector3(...point)) : null;
  }

  // How far the tool has moved since the last picture; null where it is not followed.
  moved() {
    if (!this.followed) return null;
    const here = this.toolPlace(), way = here?.clone().sub(this.followed);
    if (here) this.followed = here;
    return way ?? null;
  }
}
