// An exported page, which contains its scene: shows the scene and the plots beside it.
"use strict";

const stage = document.createElement("main");
const side = document.createElement("aside");
stage.id = "stage";
side.id = "side";
document.body.append(stage, side);
for (const part of document.querySelectorAll("#meshcat-pane, #caption, .player, .moments")) {
  stage.append(part);
}

barHeight = 0;  // the bar is below the picture

commandHandlers.show = ({arrays, commands, plots, about, runs}) => {
  const unpacked = arrays.map(unpackArray);
  viewer.set_3d_pane_size();
  viewer.handle_command(withArrays(commands, unpacked));
  if (!plots) return document.body.classList.add("alone", "without-plots");
  const drawn = new Plots(player, side, withArrays(plots, unpacked));
  if (runs) new RunSwitch(viewer, stage, drawn, runs);
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
  side.append(foot);
}

// Show or hide the plots; the scene takes their space.
function toggleSide() {
  document.body.classList.toggle("alone");
}
const sideButton = document.createElement("button");
sideButton.className = "side";
sideButton.title = "Plots (g)";
sideButton.setAttribute("aria-label", "Show or hide the plots");
sideButton.innerHTML = '<svg viewBox="0 0 24 24"><path d="M4 4h1.8v14.2H20V20H4zM7.5 15l3.6-5 '
  + '3.2 3 4.4-7 1.6 1-5.6 9-3.3-3.1-2.5 3.4z"/></svg>';
sideButton.onclick = toggleSide;
document.querySelector(".player .present").before(sideButton);
addEventListener("keydown", (event) => {
  if (document.body.classList.contains("without-plots")) return;
  if (event.key !== "g" || event.ctrlKey || event.metaKey || event.altKey) return;
  toggleSide();
});

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
