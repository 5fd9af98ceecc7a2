// Meshcat's viewer, told a few more words than it knows: see hsp_control/viewer/commands.py.
"use strict";

const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
const meshcat = viewer.handle_command.bind(viewer);

// Our own lights, floor and grid come with the scene; they fit the robot.
for (const name of ["Lights", "Grid", "Axes"]) viewer.delete_path([name]);

const player = new Player(viewer);
new Controls(player, document.body);

const words = {camera, caption, time, status, trail, trail_more, clip, still, seek, ask, set_object,
               nothing() {}};
viewer.handle_command = (command) => {
  if (Array.isArray(command)) command.forEach(viewer.handle_command);
  else (words[command.type] ?? meshcat)(command);
  viewer.set_dirty();
};

function node(path) {
  return viewer.scene_tree.find(path.split("/").filter((name) => name.length > 0)).object;
}

// Some mesh files have no normals and would be black.
function set_object(command) {
  meshcat(command);
  node(command.path).traverse(({geometry}) => {
    if (geometry?.isBufferGeometry && !geometry.attributes.normal) geometry.computeVertexNormals();
  });
}

// Pinocchio's z is up, three.js's y.
function vector([x, y, z]) { return new MeshCat.THREE.Vector3(x, z, -y); }

// Look at a target, from an eye or, along a direction, from where all balls are seen.
function camera({target, eye, direction, up, points, radius, field_of_view}) {
  const center = vector(target);
  const toEye = vector(eye ?? direction);
  if (eye) toEye.sub(center);
  const distance = eye ? toEye.length() : 0;
  toEye.normalize();
  const tall = Math.tan(field_of_view * Math.PI / 360);
  const {clientWidth, clientHeight} = viewer.dom_element;
  const wide = tall * (clientWidth / clientHeight || 1.5);
  const right = vector(up).cross(toEye).normalize();
  const above = toEye.clone().cross(right);
  const needed = (point) => {
    const offset = vector(point).sub(center);
    const x = Math.abs(offset.dot(right)) + radius, y = Math.abs(offset.dot(above)) + radius;
    return offset.dot(toEye) + Math.max(x / wide, y / tall);
  };
  const away = distance || Math.max(...points.map(needed));
  const lens = viewer.camera;
  lens.fov = field_of_view;
  lens.near = away / 100;
  lens.far = away * 100;
  lens.up.copy(vector(up));
  lens.position.copy(center).addScaledVector(toEye, away);
  viewer.controls.dispose();
  viewer.set_camera(lens);  // new controls, that orbit about the new up
  viewer.controls.target.copy(center);
}

function caption({title, legend}) {
  document.title = title;
  document.querySelector("#caption h1").textContent = title;
  document.querySelector("#caption ul").replaceChildren(...legend.map(({name, color}) => {
    const entry = document.createElement("li");
    entry.textContent = name;
    entry.style.setProperty("--color", color);
    return entry;
  }));
}

// The clock of a scene that is shown from outside, step by step.
function time({text}) { document.querySelector("#caption .time").textContent = text; }

// What the program behind the page is doing.
function status({text}) {
  const line = document.querySelector("#caption .status");
  line.textContent = text;
  line.hidden = !text;
}

function trail(command) {
  viewer.set_object(command.path.split("/").filter(Boolean), trailMesh(command));
}

function trail_more({path, points}) { extendTrail(node(path), points); }

// A clip, or what comes after the last one's end.
function clip(command) {
  if (command.begins) player.load(command, command.keep);
  else player.extend(command);
}

// Take the clip away: the scene is shown from outside from now on.
function still() { player.unload(); }

function seek({time}) {
  player.pause();
  player.seek(time);
}

// Answer once all that came before is drawn.
function ask({number}) {
  viewer.render();
  viewer.connection.send(String(number));
}

// Follow the server; when it ends, wait for the next one at the same address.
function connect(again = false) {
  const address = new URL("scene", location.href);
  address.protocol = address.protocol.replace("http", "ws");
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  viewer.connection = socket;
  socket.onopen = () => { if (again) location.reload(); };
  socket.onmessage = ({data}) => {
    viewer.handle_command_bytearray(new Uint8Array(data));
    socket.send("taken");  // only then comes the next: nothing out of date waits in between
  };
  socket.onclose = () => {
    document.getElementById("lost").hidden = false;
    setTimeout(connect, 1000, true);
  };
}
