// An exported page, which contains its scene: shows the scene, the plots beside it, and a switch
// between several runs.
"use strict";

const side = new Side(player);

commandHandlers.show = ({arrays, commands, plots, about, runs}) => {
  const unpacked = arrays.map(unpackArray);
  viewer.set_3d_pane_size();
  viewer.handle_command(withArrays(commands, unpacked));
  if (!plots) return;
  side.show(withArrays(plots, unpacked));
  if (runs) new RunSwitch(viewer, side, runs);
  side.box.append(footer(about));
};

// The descriptions and the facts of the runs, below the plots.
function footer(runs) {
  const help = matchMedia("(pointer: coarse)").matches
    ? "In the plots: tap or drag to a time, pinch to zoom; tap a name to see it alone."
    : "In the plots: click to go to a time, drag to zoom, Esc for the whole run; click a name "
      + "to see it alone.";
  const foot = make("footer", {}, make("p", {className: "help"}, help));
  let last = "";
  for (const {name, text, facts} of runs) {
    if (text && text !== last) foot.append(make("p", {}, text));
    last = text;
    const list = facts.map(([what, value]) => `${what} ${value}`);
    const told = (runs.length > 1 ? [name, ...list] : list).join("  ·  ");
    foot.append(make("p", {className: "facts"}, told));
  }
  return foot;
}

// The switch over the scene: one of the runs, or all; `w` shows the next choice. Of one run the
// robot and all layers are shown, of all runs the first, and of the others a ghost and its paths.
// A run that is not shown is in a layer of three.js that no camera sees: so the switches of the
// legend keep their meaning. Runs without `parts` stand side by side, and stay in sight. The data
// are those of viewer/export_page.py.
class RunSwitch {
  static UNSEEN = 1;  // the layer of three.js; cameras see layer 0

  constructor(viewer, side, {names, parts, colors, opacity}) {
    Object.assign(this, {viewer, side, parts, colors, opacity, solid: new Map()});
    this.choices = [...names.keys(), null];
    this.names = names;
    this.buttons = this.choices.map((run) => {
      const text = run !== null ? names[run] : names.length === 2 ? "both" : "all";
      return makeButton({title: `${text} (w: the next)`}, () => this.select(run),
                        ...(run !== null ? [Side.sample(run)] : []), make("span", {}, text));
    });
    side.stage.append(make("div", {className: "run-switch", role: "group",
                                   ariaLabel: "Runs (w: the next)"}, ...this.buttons));
    onKey(({key}) => key === "w" && (() => {
      const next = this.choices.indexOf(this.selected) + 1;
      this.select(this.choices[next % this.choices.length]);
    }));
    this.select(null);
  }

  // Show one run; null: all.
  select(run) {
    this.selected = run;
    this.buttons.forEach((button, k) => { button.ariaPressed = this.choices[k] === run; });
    this.parts.forEach((paths, k) => this.place(paths, k, run));
    this.side.select(run);
    this.side.player.select(this.names[run] ?? null);
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
    const hidden = (thing) => thing.layers.set(seen ? 0 : RunSwitch.UNSEEN);
    findNode(this.viewer, path)?.object.traverse(hidden);
  }

  // Make the robot of a run a ghost, or solid again.
  tint(path, ghost, run) {
    const robot = findNode(this.viewer, path)?.object;
    if (!robot) return;
    eachMaterial(robot, (material) => {
      if (!this.solid.has(material)) {
        const {opacity, transparent, polygonOffset} = material;
        this.solid.set(material, {color: material.color?.clone(), opacity, transparent, polygonOffset});
      }
      const {color, ...solid} = this.solid.get(material);
      if (color) material.color.copy(color);
      Object.assign(material, solid, {needsUpdate: true});
    });
    robot.traverse((thing) => {
      thing.userData.cast ??= thing.castShadow;
      thing.castShadow = thing.userData.cast;
    });
    if (ghost) makeGhost(robot, this.colors[run], this.opacity);
  }
}

// `page.html#t=2.5` opens the page paused at that time.
function openAtHash() {
  const time = new URLSearchParams(location.hash.slice(1)).get("t");
  if (time === null || !Number.isFinite(Number(time))) return;
  player.pause();
  player.seek(Number(time));
}
addEventListener("hashchange", openAtHash);

function begin(content) {
  viewer.handle_command_bytearray(content);
  openAtHash();
  document.body.dataset.ready = "yes";
}
