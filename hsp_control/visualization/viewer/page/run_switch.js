// The switch between several runs, over the scene: one of them, or all.
//
//   new RunSwitch(viewer, stage, plots, {names, parts, colors, opacity});
//
// with the data of viewer/export/html.py. Of one run the robot and all layers are shown, of all
// runs the first, and of the others a ghost and its paths. `w` shows the next choice. A run that
// is not shown is in a layer of three.js that no camera sees: so the switches of the legend
// keep their meaning. Runs without `parts` stand side by side, and stay in sight.
"use strict";

class RunSwitch {
  static UNSEEN = 1;  // the layer of three.js; cameras see layer 0

  constructor(viewer, parent, plots, {names, parts, colors, opacity}) {
    Object.assign(this, {viewer, plots, parts, colors, opacity, solid: new Map()});
    this.box = document.createElement("div");
    this.box.className = "run-switch";
    this.box.setAttribute("role", "group");
    this.box.setAttribute("aria-label", "Runs (w: the next)");
    this.choices = [...names.keys(), null];
    this.buttons = this.choices.map((run) => {
      const button = document.createElement("button");
      button.type = "button";
      const text = run !== null ? names[run] : names.length === 2 ? "both" : "all";
      button.title = `${text} (w: the next)`;
      if (run !== null) button.append(Plots.sample(run));
      button.append(Object.assign(document.createElement("span"), {textContent: text}));
      button.onclick = (event) => {
        this.select(run);
        if (event.detail) button.blur();  // return the keyboard to the player
      };
      return button;
    });
    this.box.append(...this.buttons);
    this.box.addEventListener("keydown", (event) => {
      if (event.key === " " || event.key === "Enter") event.stopPropagation();
    });
    parent.append(this.box);
    addEventListener("keydown", (event) => {
      if (event.key !== "w" || event.ctrlKey || event.metaKey || event.altKey) return;
      const next = this.choices.indexOf(this.selected) + 1;
      this.select(this.choices[next % this.choices.length]);
    });
    this.select(null);
  }

  // Show one run; null: all.
  select(run) {
    this.selected = run;
    this.buttons.forEach((button, k) => {
      button.setAttribute("aria-pressed", this.choices[k] === run);
    });
    this.parts.forEach((paths, k) => this.place(paths, k, run));
    this.plots.select(run);
    this.viewer.set_dirty();
  }

  place(paths, run, selected) {
    const ghost = selected === null && run > 0;
    for (const path of paths) this.show(path, !ghost && (selected ?? run) === run);
    if (!run) return;
    const robot = `${paths[0]}/robot`;
    for (const path of [robot, `${paths[0]}/paths`]) if (ghost) this.show(path, true);
    this.tint(robot, ghost, run);
  }

  show(path, seen) {
    layers.find(path)?.traverse((thing) => thing.layers.set(seen ? 0 : RunSwitch.UNSEEN));
  }

  // Make the robot of a run a ghost, or solid again.
  tint(path, ghost, run) {
    const robot = layers.find(path);
    if (!robot) return;
    const tint = new MeshCat.THREE.Color(this.colors[run]);
    eachMaterial(robot, (material) => {
      if (!this.solid.has(material)) {
        const {opacity, transparent, depthWrite, polygonOffset} = material;
        const color = material.color?.clone();
        this.solid.set(material, {color, opacity, transparent, depthWrite, polygonOffset});
      }
      const {color, ...solid} = this.solid.get(material);
      if (color) material.color.copy(color);
      Object.assign(material, solid, {needsUpdate: true});
      if (!ghost) return;
      material.color?.lerp(tint, 0.6);
      // Where it coincides with a solid object, it is drawn behind it.
      const behind = {polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8};
      Object.assign(material, {opacity: this.opacity, transparent: true, ...behind});
    });
    robot.traverse((thing) => {
      thing.userData.cast ??= thing.castShadow;
      thing.castShadow = thing.userData.cast && !ghost;
    });
  }
}
