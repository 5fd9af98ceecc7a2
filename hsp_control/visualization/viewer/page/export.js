// An exported page, which contains its scene: shows the scene and the plots beside it.
"use strict";

const side = new Side(player);

commandHandlers.show = ({arrays, commands, plots, about, runs}) => {
  const unpacked = arrays.map(unpackArray);
  viewer.set_3d_pane_size();
  viewer.handle_command(withArrays(commands, unpacked));
  if (!plots) return;
  const drawn = side.show(withArrays(plots, unpacked));
  if (runs) new RunSwitch(viewer, side.stage, drawn, runs);
  addFooter(about);
};

// The descriptions and the facts of the runs, below the plots.
function addFooter(runs) {
  const foot = document.createElement("footer");
  const add = (textContent, className = "") => {
    foot.append(Object.assign(document.createElement("p"), {textContent, className}));
  };
  const help = matchMedia("(pointer: coarse)").matches
    ? "In the plots: tap or drag to a time, pinch to zoom; tap a name to see it alone."
    : "In the plots: click to go to a time, drag to zoom, Esc for the whole run; click a name "
      + "to see it alone.";
  add(help, "help");
  let last = "";
  for (const {name, text, facts} of runs) {
    if (text && text !== last) add(text);
    last = text;
    const list = facts.map(([what, value]) => `${what} ${value}`);
    add((runs.length > 1 ? [name, ...list] : list).join("  ·  "), "facts");
  }
  side.box.append(foot);
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
