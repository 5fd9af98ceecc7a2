// An exported page: shows the scene, the plots beside it, and a switch between several runs.
"use strict";

const side = new Side(player);

commandHandlers.show = (content) => {
  const {commands, plots, about, runs} = withArrays(content, content.arrays.map(unpackArray));
  viewer.set_3d_pane_size();
  viewer.handle_command(commands);
  if (!plots) return;
  side.show(plots);
  if (runs) new RunSwitch(viewer, side, runs);
  side.box.append(make("footer", {}, ...about.map((text) => make("p", {}, text))));
};

// The switch over the scene: one of the runs, or all; `w` shows the next choice. Of one run the robot
// and all layers are shown, of all runs the first, and of the others a ghost and its paths. A run that
// is not shown is in a layer of three.js that no camera sees: so the switches of the legend keep their
// meaning. Runs without `parts` stand side by side, and stay in sight.
class RunSwitch {
  constructor(viewer, side, {names, parts, colors, opacity}) {
    Object.assign(this, {viewer, side, names, parts, colors, opacity});
    this.choices = [...names.keys(), null];
    this.buttons = this.choices.map((run) => {
      const text = names[run] ?? (names.length === 2 ? "both" : "all");
      return makeButton({title: `${text} (w: next)`}, () => this.select(run),
                        ...(run === null ? [] : [Side.sample(run)]), make("span", {}, text));
    });
    part("#stage").append(make("div", {className: "run-switch", role: "group",
                                   ariaLabel: "Runs (w: next)"}, ...this.buttons));
    onKey(({key}) => key === "w" && (() => {
      const next = this.choices.indexOf(this.selected) + 1;
      this.select(this.choices[next % this.choices.length]);
    }));
    this.select(null);
  }

  select(run) {
    this.selected = run;
    this.buttons.forEach((button, k) => { button.ariaPressed = this.choices[k] === run; });
    this.parts.forEach((paths, k) => this.place(paths, k));
    this.side.select(run);
    this.side.player.set({run: this.names[run] ?? null});
    this.viewer.set_dirty();
  }

  place(paths, run) {
    const {selected} = this, ghost = selected === null && run > 0;
    for (const path of paths) this.show(path, !ghost && (selected ?? run) === run);
    if (!run) return;
    const [root] = paths, robot = findNode(this.viewer, `${root}/robot`).object;
    makeSolid(robot);
    if (!ghost) return;
    makeGhost(robot, this.colors[run], this.opacity);
    for (const part of ["robot", "paths"]) this.show(`${root}/${part}`, true);
  }

  show(path, seen) {
    findNode(this.viewer, path)?.object.traverse(({layers}) => {
      layers.set(seen ? 0 : 1);  // cameras see layer 0
    });
  }
}

// `page.html#t=2.5` opens the page paused at that time.
function openAtHash() {
  const time = Number(new URLSearchParams(location.hash.slice(1)).get("t") ?? NaN);
  if (Number.isFinite(time)) player.halt(time);
}
on(window, "hashchange", openAtHash);

function begin(content) {
  viewer.handle_command_bytearray(content);
  openAtHash();
  document.body.dataset.ready = "yes";
}
