// The scene: Meshcat's viewer, and what the program says to it beside Meshcat's own commands; see
// viewer/commands.py.
"use strict";

const viewer = newViewer(part("#meshcat-pane"));
const meshcat = viewer.handle_command.bind(viewer);

// The scene brings its own lights, floor and grid, which fit the robot.
for (const name of ["Lights", "Grid", "Axes"]) viewer.delete_path([name]);
// Its own controls go, too: the legend has the switches, the player the time. The scene tree
// needs them, but nobody has to see them.
viewer.gui.domElement.remove();

viewer.renderer.shadowMap.type = MeshCat.THREE.VSMShadowMap;  // soft edges

const player = new Player(viewer);
new PlayerBar(player, part(".player"));
const legend = new Legend(viewer);
const lengthLabels = new LengthLabels(viewer);
let placed = null;  // the last camera of the program, and where it was placed then
const drawScene = viewer.render.bind(viewer);
viewer.render = () => {
  // Meshcat's controls round the position anew each time: begin from the same, so that the
  // same time gives the same image.
  if (untouched()) viewer.camera.position.copy(placed.position);
  drawScene();
  lengthLabels.update();
};

// Meshcat takes the window's height; here the element's counts, which may be a part of it.
const fitPane = viewer.set_3d_pane_size.bind(viewer);
viewer.set_3d_pane_size = () => {
  const {clientWidth, clientHeight} = viewer.dom_element;
  if (clientWidth && clientHeight) fitPane(clientWidth, clientHeight);
};
new ResizeObserver(refit).observe(viewer.dom_element);
const presentation = new Presentation(refit);
presentation.addButton(part(".player .present"));

const say = (name, text) => { part(`#caption .${name}`).textContent = text; };
const commandHandlers = {
  camera, caption, set_object, ask,
  nothing() {},
  // The time that the program sets, without a clip; and its status.
  time({text}) { say("time", text); },
  status({text}) { say("status", text); },
  ghost({path, color, opacity}) { makeGhost(node(path), color, opacity); },
  trail(command) {
    viewer.set_object(command.path.split("/").filter(Boolean), trailMesh(command));
  },
  length_label({path}) { lengthLabels.paths.add(path); },
  // Load a clip, or append an extension to the current one.
  clip(command) { if (command.begins) player.load(command, command.keep); else player.extend(command); },
  // Remove the clip; from now on the program moves the scene.
  still() { player.unload(); },
  // Show one instant of tracks, without a clip.
  pose({tracks}) { player.pose(tracks); },
  seek({time}) {
    player.pause();
    player.seek(time);
  },
};
viewer.handle_command = (command) => {
  for (const each of [command].flat(Infinity)) (commandHandlers[each.type] ?? meshcat)(each);
  legend.apply();  // nodes that were drawn again
  viewer.set_dirty();
};

// Without WebGL nothing can be drawn: the page says so instead of staying empty.
function newViewer(pane) {
  try {
    return new MeshCat.Viewer(pane);
  } catch (error) {
    pane.className = "without-webgl";
    pane.textContent = "This browser cannot draw in three dimensions: WebGL is off or not "
      + "supported. Turn on hardware acceleration, or open the page in another browser.";
    throw error;
  }
}

// What surrounds a dark stage, for surfaces to mirror: soft boxes above and beside it.
function studio() {
  const {Scene, Mesh, BoxGeometry, MeshBasicMaterial, BackSide, PMREMGenerator} = MeshCat.THREE;
  const room = new Scene();
  const box = (size, place, brightness, side = 0) => {
    const material = new MeshBasicMaterial({side});
    material.color.setScalar(brightness);  // beyond 1: a lamp
    const mesh = new Mesh(new BoxGeometry(...size), material);
    mesh.position.set(...place);
    room.add(mesh);
  };
  box([20, 20, 20], [0, 0, 0], 0.12, BackSide);
  box([6, 0.2, 3], [2, 7, 3], 5);
  box([0.2, 5, 8], [-8, 2, 0], 1.6);
  box([0.2, 5, 3], [8, 3, -5], 2.8);
  const maker = new PMREMGenerator(viewer.renderer), {texture} = maker.fromScene(room, 0.04);
  maker.dispose();
  return texture;
}

// The object of a node, which is created if there is none.
function node(path) { return viewer.scene_tree.find(path.split("/").filter(Boolean)).object; }

function caption({title, legend: entries, dark}) {
  document.title = title;
  document.body.classList.toggle("dark", dark);
  viewer.scene.environment = dark ? viewer.scene.environment ?? studio() : null;
  part("#caption h1").textContent = title;
  legend.show(entries);
  refit();  // now it is known what title and legend cover
}

// Answer once all previous commands are drawn.
function ask({number}) {
  viewer.render();
  viewer.connection.send(String(number));
}

// Connect to the server. When it ends the page says so, and loads the next one at this address.
function connect() {
  const address = new URL("scene" + location.search, location.href);  // with its key
  address.protocol = address.protocol.replace("http", "ws");
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  viewer.connection = socket;
  socket.onmessage = ({data}) => {
    viewer.handle_command_bytearray(new Uint8Array(data));
    socket.send("taken");  // flow control: the server sends the next message after it
  };
  socket.onclose = () => {
    document.body.classList.add("lost");
    commandHandlers.lost?.();
    lookForNext();
  };
}

async function lookForNext() {
  const {ok, status} = await fetch(location).catch(() => ({}));
  if (ok) return location.reload();
  const text = "The program has ended. " + (status === 403
    ? "Another one runs here now: open the address that it has printed."
    : "Its next start at this address will appear here.");
  Object.assign(part("#lost"), {hidden: false, textContent: text});
  setTimeout(lookForNext, 1000);
}

// -- the camera --

// From Pinocchio's axes (z up) to those of three.js (y up).
function vector([x, y, z]) { return new MeshCat.THREE.Vector3(x, z, -y); }

// Shares of the picture's height that are reserved for the player's bar and the title.
const BAR = 0.1, TITLE = 0.06;
const WIDE = 16 / 9;  // width over height
let barHeight = 64;  // what the player's bar covers at the bottom of the picture [px]

// Half the width of the robot's widest link [m]: the points are those of its skeleton.
function girth() {
  const size = new MeshCat.THREE.Vector3(), scale = new MeshCat.THREE.Vector3();
  let widest = 0;
  findNode(viewer, "/robot")?.object.traverse((mesh) => {
    if (!mesh.geometry?.isBufferGeometry) return;
    mesh.geometry.boundingBox ?? mesh.geometry.computeBoundingBox();
    mesh.geometry.boundingBox.getSize(size).multiply(mesh.getWorldScale(scale));
    const [, width] = size.toArray().sort((one, other) => one - other);  // the middle one of its edges
    widest = Math.max(widest, width / 2);
  });
  return widest;
}

// Look at a target from an eye, or along a direction from a distance at which all balls
// around the points are visible. An eye is chosen for a wide window: in a narrower one it
// moves back until the points are in sight, or as much of them as in the wide one.
function camera(command) {
  const {target, eye, direction, up, points, field_of_view} = command;
  const radius = Math.max(command.radius, girth());
  const center = vector(target);
  const toEye = vector(eye ?? direction);
  if (eye) toEye.sub(center);
  const distance = eye ? toEye.length() : 0;
  toEye.normalize();
  const tall = Math.tan(field_of_view * Math.PI / 360);
  const {clientWidth, clientHeight} = viewer.dom_element;
  const aspect = clientWidth / clientHeight || 1.5;
  const wide = tall * aspect;
  const bar = Math.max(BAR, barHeight / (clientHeight || 640));
  const title = Math.max(TITLE, legend.covered / (clientHeight || 640));
  const right = vector(up).cross(toEye).normalize();
  const above = toEye.clone().cross(right);
  const offsets = points.map((point) => vector(point).sub(center));
  const needed = (offset) => {
    const x = Math.abs(offset.dot(right)) + radius, y = Math.abs(offset.dot(above)) + radius;
    const across = x / wide, upwards = eye ? 0 : y / (tall * (1 - bar - title));
    return offset.dot(toEye) + Math.max(across, upwards);
  };
  let away = Math.max(...offsets.map(needed));
  if (eye) away = Math.min(Math.max(away, distance), distance * Math.max(WIDE / aspect, 1));
  const lens = viewer.camera;
  Object.assign(lens, {fov: field_of_view, near: away / 100, far: away * 100});
  lens.up.copy(vector(up));
  lens.position.copy(center).addScaledVector(toEye, away);
  // To the right, to be beside the legend if there is space; the picture is 2 wide.
  const half = (offset) => (away - offset.dot(toEye)) * wide;
  const ends = (side) => offsets.map((o) => (o.dot(right) + side * radius) / half(o));
  const edge = 2 * legend.reach / (clientWidth || Infinity) - 1;
  const shift = Math.max(Math.min(edge - Math.min(...ends(-1)), 1 - Math.max(...ends(1))), 0);
  lens.setViewOffset(1, 1, -shift / 2, (bar - title) / 2, 1, 1);
  viewer.set_3d_pane_size();
  viewer.controls.dispose();
  viewer.set_camera(lens);  // new controls, which orbit about the new up direction
  viewer.controls.target.copy(center);
  placed = {command, position: lens.position.clone(), target: center.clone(), slack: 1e-9 * away};
}

// Whether the camera is where the program placed it.
function untouched() {
  const {camera: lens, controls} = viewer;
  return placed !== null && lens.position.distanceTo(placed.position) < placed.slack
    && controls.target.distanceTo(placed.target) < placed.slack;
}

// Place the camera again for another size of the window, unless the user has moved it.
function refit() {
  viewer.set_3d_pane_size();
  if (untouched()) camera(placed.command);
  viewer.set_dirty();
}

// -- mesh files --

// Meshcat merges the parts of a mesh file into one geometry. It loses which triangles of a
// part have which material, and then does not draw them; and it fails if only some parts
// have texture coordinates. Both are corrected here.
function set_object(command) {
  const {BufferGeometry, BufferAttribute} = MeshCat.THREE;
  const apply = BufferGeometry.prototype.applyMatrix4;
  BufferGeometry.prototype.applyMatrix4 = function (matrix) {  // called for each part
    const {groups, attributes: {position: {count}, uv}} = this;
    if (!uv) this.setAttribute("uv", new BufferAttribute(new Float32Array(2 * count), 2));
    this.userData = {groups};  // which the merged geometry keeps
    return apply.call(this, matrix);
  };
  try {
    meshcat(command);
  } finally {
    BufferGeometry.prototype.applyMatrix4 = apply;
  }
  node(command.path).traverse((object) => {
    const {geometry, material} = object;
    if (geometry?.userData.mergedUserData && Array.isArray(material)) assignMaterials(object);
    // Without normals, a mesh would be black.
    if (geometry?.isBufferGeometry && !geometry.attributes.normal) geometry.computeVertexNormals();
    if (material) object.material = Array.isArray(object.material)
      ? object.material.map(lit) : lit(object.material);
  });
}

// A material of a mesh file, lit as all others are.
function lit(material) {
  if (!material.isMeshPhongMaterial && !material.isMeshLambertMaterial) return material;
  const standard = new MeshCat.THREE.MeshStandardMaterial({roughness: 0.5});
  for (const name of ["color", "map", "opacity", "transparent", "side"]) {
    standard[name] = material[name] ?? standard[name];
  }
  return standard;
}

// Assign its material to each group of triangles of a merged mesh, which has a group for each part.
function assignMaterials(mesh) {
  const {groups: parts, userData: {mergedUserData: own}} = mesh.geometry, materials = [];
  mesh.geometry.clearGroups();
  parts.forEach(({start: first, count: size}, part) => {
    const whole = {start: 0, count: size, materialIndex: 0}, {groups} = own[part];
    for (const {start, count, materialIndex} of groups.length ? groups : [whole]) {
      mesh.geometry.addGroup(first + start, count, materials.length);
      materials.push([mesh.material[part]].flat()[materialIndex]);
    }
  });
  mesh.material = materials;
}
