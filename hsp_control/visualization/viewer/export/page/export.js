// A page that holds its scene: puts plots beside it and shows both.
"use strict";

const stage = document.createElement("main");
const side = document.createElement("aside");
stage.id = "stage";
side.id = "side";
document.body.append(stage, side);
for (const part of document.querySelectorAll("#meshcat-pane, .dg.main, #caption, .player")) {
  stage.append(part);
}

// Meshcat takes the window's height; here the scene shares it.
const fitPane = viewer.set_3d_pane_size.bind(viewer);
viewer.set_3d_pane_size = () => {
  const {clientWidth, clientHeight} = viewer.dom_element;
  if (clientWidth && clientHeight) fitPane(clientWidth, clientHeight);
};

// All stays in sight when the window changes, until one looks from elsewhere.
let shot = null;
const place = words.camera;
words.camera = (command) => {
  shot = command;
  place(command);
  viewer.controls.addEventListener("start", () => { shot = null; });
};
function refit() {
  viewer.set_3d_pane_size();
  if (shot) words.camera(shot);
  viewer.set_dirty();
}
new ResizeObserver(refit).observe(viewer.dom_element);

words.show = ({arrays, commands, plots, about}) => {
  const made = arrays.map(unpackArray);
  viewer.set_3d_pane_size();
  viewer.handle_command(withArrays(commands, made));
  new Plots(player, side, withArrays(plots, made));
  tell(about);
};

// What the run was, under the plots.
function tell({text, facts}) {
  const foot = document.createElement("footer");
  if (text) foot.append(Object.assign(document.createElement("p"), {textContent: text}));
  const list = document.createElement("p");
  list.className = "facts";
  list.textContent = facts.map(([name, value]) => `${name} ${value}`).join("  ·  ");
  foot.append(list);
  side.append(foot);
}

// Show or hide the plots; the scene takes the room.
function toggleSide() {
  document.body.classList.toggle("alone");
}
const sideButton = document.createElement("button");
sideButton.className = "side";
sideButton.title = "Plots (p)";
sideButton.setAttribute("aria-label", "Show or hide the plots");
sideButton.innerHTML = '<svg viewBox="0 0 24 24"><path d="M4 4h1.8v14.2H20V20H4zM7.5 15l3.6-5 '
  + '3.2 3 4.4-7 1.6 1-5.6 9-3.3-3.1-2.5 3.4z"/></svg>';
sideButton.onclick = toggleSide;
document.querySelector(".player").append(sideButton);
addEventListener("keydown", (event) => {
  if (event.key !== "p" || event.ctrlKey || event.metaKey || event.altKey) return;
  toggleSide();
});

// `page.html#t=2.5` opens at rest at that time.
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
