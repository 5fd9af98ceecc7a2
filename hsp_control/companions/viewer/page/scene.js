// The scene: Meshcat's viewer, and the program's commands beyond Meshcat's own.
"use strict";

const viewer = newViewer(part("#meshcat-pane"));
const meshcat = viewer.handle_command.bind(viewer);

// The scene brings its own lights, floor and grid, which fit the robot, and its own controls.
for (const name of ["Lights", "Grid", "Axes"]) viewer.delete_path([name]);
viewer.gui.domElement.remove();
viewer.renderer.shadowMap.type = MeshCat.THREE.VSMShadowMap;  // soft edges

const player = new Player(viewer), legend = new Legend(viewer);
new PlayerBar(player, part(".player"));
const lengthLabels = new LengthLabels(viewer);
const views = new Views(viewer, camera);
let placed = null;  // the last camera of the program, and where it was placed then
const drawScene = viewer.render.bind(viewer);
viewer.render = () => {
  followTool();
  // Meshcat's controls round the position anew each time: begin from the same, so that the
  // same time gives the same image.
  if (untouched()) viewer.camera.position.copy(placed.position);
  drawScene();
  lengthLabels.update();
};

// Meshcat uses the window's height; here that of the element, which may be a part of it.
const fitPane = viewer.set_3d_pane_size.bind(viewer);
viewer.set_3d_pane_size = () => {
  const {clientWidth, clientHeight} = viewer.dom_element;
  if (clientWidth && clientHeight) fitPane(clientWidth, clientHeight);
};
new ResizeObserver(refit).observe(viewer.dom_element);
const presentation = new Presentation(refit);
presentation.addButton(part(".player .present"));

const commandHandlers = {
  caption, set_object, ask,
  camera(command) { views.begin(command); },
  nothing() {},
  time({text}) { part("#caption .time").textContent = text; },
  status({text}) { part("#caption .status").textContent = text; },
  ghost({path, color, opacity}) { makeGhost(node(path), color, opacity); },
  trail(command) { viewer.set_object(elements(command.path), trailMesh(command)); },
  mesh_file({file, data, resources}) { meshFiles.set(file, {data, resources}); },
  length_label({path}) { lengthLabels.paths.add(path); },
  clip(command) { if (command.begins) player.load(command, command.keep); else player.extend(command); },
  still() { player.unload(); },
  pose({tracks}) { player.pose(tracks); },
  seek({time}) { player.halt(time); },
};
viewer.handle_command = (command) => {
  for (const each of [command].flat(Infinity)) (commandHandlers[each.type] ?? meshcat)(each);
  legend.apply();  // nodes that were drawn again
  viewer.set_dirty();
};

// Without WebGL nothing can be drawn: the page shows a message instead of staying empty.
function newViewer(pane) {
  try {
    return new MeshCat.Viewer(pane);
  } catch (error) {
    part(".without-webgl").hidden = false;
    throw error;
  }
}

// Without a graphics card a picture takes a second. Without shadows and mirrors it takes a fifth.
let drawsLightly = false;

function isSoftware() {
  const gl = viewer.renderer.getContext(), about = gl.getExtension("WEBGL_debug_renderer_info");
  const name = about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : "";
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

function drawLightly() {
  drawsLightly = true;
  viewer.renderer.shadowMap.enabled = false;
  viewer.renderer.setPixelRatio(Math.min(devicePixelRatio, 1));
  viewer.scene.environment = null;
  viewer.scene.traverse(simplify);
  viewer.set_3d_pane_size();
  viewer.set_dirty();
}

// `page.html#light` asks for it, before the first picture.
if (new URLSearchParams(location.hash.slice(1)).has("light")) drawLightly();

function simplify(object) {
  if (object.isLight) object.castShadow = false;
  if (!object.material) return;
  const simple = (one) => {
    if (!one.isMeshStandardMaterial) return one;
    const {color, map, opacity, transparent, side, depthTest, depthWrite} = one;
    const {emissive, emissiveIntensity} = one;
    return new MeshCat.THREE.MeshLambertMaterial(
      {color, map, opacity, transparent, side, depthTest, depthWrite, emissive, emissiveIntensity});
  };
  object.material = Array.isArray(object.material)
    ? object.material.map(simple) : simple(object.material);
}

// The surroundings of a dark stage, for surfaces to mirror: soft boxes above and beside it.
function studio() {
  const {Scene, Mesh, BoxGeometry, MeshBasicMaterial, BackSide, PMREMGenerator} = MeshCat.THREE;
  const room = new Scene();
  const walls = [[20, 20, 20], [0, 0, 0], 0.12, BackSide];
  const lamps = [[[6, 0.2, 3], [2, 7, 3], 5], [[0.2, 5, 8], [-8, 2, 0], 1.6],
                 [[0.2, 5, 3], [8, 3, -5], 2.8]];
  for (const [size, place, brightness, side = 0] of [walls, ...lamps]) {
    const mesh = new Mesh(new BoxGeometry(...size), new MeshBasicMaterial({side}));
    mesh.material.color.setScalar(brightness);  // beyond 1: a lamp
    mesh.position.set(...place);
    room.add(mesh);
  }
  const maker = new PMREMGenerator(viewer.renderer), {texture} = maker.fromScene(room, 0.04);
  maker.dispose();
  return texture;
}

// The object of a node, which is created if there is none.
function node(path) { return viewer.scene_tree.find(elements(path)).object; }

function caption({title, legend: entries, dark}) {
  document.title = title;
  document.body.classList.toggle("dark", dark);
  viewer.scene.environment = dark && !drawsLightly ? viewer.scene.environment ?? studio() : null;
  part("#caption h1").textContent = title;
  legend.show(entries);
  refit();  // the sizes of title and legend are known now
}

function ask({number}) {
  viewer.render();
  viewer.connection.send(String(number));
}

// Connect to the server. When it ends the page shows a message, and loads the next one at this
// address.
function connect() {
  const address = new URL("scene" + location.search, location.href);  // with its key
  address.protocol = address.protocol.replace("http", "ws");
  const unpacks = typeof DecompressionStream === "function";
  if (unpacks) address.searchParams.set("gzip", "1");
  const socket = new WebSocket(address);
  socket.binaryType = "arraybuffer";
  viewer.connection = socket;
  socket.onmessage = ({data}) => {
    const bytes = new Uint8Array(data);
    const take = (message) => {
      viewer.handle_command_bytearray(message);
      socket.send("taken");  // flow control: the server sends the next message after it
    };
    // The meshes come compressed: 0x1F 0x8B begins no other message.
    if (bytes[0] === 0x1F && bytes[1] === 0x8B) inflated(bytes).then(take); else take(bytes);
  };
  socket.onclose = () => {
    document.body.classList.add("lost");
    commandHandlers.lost?.();
    lookForNext();
  };
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Another program, even another user's, may listen at this address. The key is not sent to it: only
// a server that has the key can answer the question.
async function lookForNext() {
  const own = await answersRightly().catch(() => null);
  if (own) return location.reload();
  part("#lost").hidden = false;
  part("#lost").classList.toggle("another", own === false);
  setTimeout(lookForNext, 1000);
}

async function answersRightly() {
  const key = new URLSearchParams(location.search).get("key") ?? "", {subtle} = crypto;
  if (!subtle) return null;  // in a network: there each start has another key
  const question = [...crypto.getRandomValues(new Uint8Array(16))]
    .map((byte) => byte.toString(16).padStart(2, "0")).join("");
  const response = await fetch(`alive?question=${question}`, {cache: "no-store"});
  if (!response.ok) return false;
  const bytes = (text) => new TextEncoder().encode(text);
  const secret = await subtle.importKey("raw", bytes(key), {name: "HMAC", hash: "SHA-256"},
                                        false, ["sign"]);
  const right = new Uint8Array(await subtle.sign("HMAC", secret, bytes(question)));
  const answer = await response.text();
  return answer === [...right].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

// From Pinocchio's axes (z up) to those of three.js (y up).
function vector([x, y, z]) { return new MeshCat.THREE.Vector3(x, z, -y); }

// Shares of the picture's height that are reserved for the player's bar and the title.
const BAR = 0.1, TITLE = 0.06, WIDE = 16 / 9;  // WIDE: width over height
let barHeight = 64;  // height that the player's bar covers at the bottom of the picture [px]

// Half the width of the robot's widest link [m]: the points are those of its skeleton.
function girth() {
  const size = new MeshCat.THREE.Vector3(), scale = new MeshCat.THREE.Vector3(), widths = [0];
  findNode(viewer, "/robot")?.object.traverse((mesh) => {
    const {geometry} = mesh;
    if (!geometry?.isBufferGeometry) return;
    if (!geometry.boundingBox) geometry.computeBoundingBox();
    geometry.boundingBox.getSize(size).multiply(mesh.getWorldScale(scale));
    widths.push(size.toArray().sort((one, other) => one - other)[1] / 2);  // the middle of its edges
  });
  return Math.max(...widths);
}

// Look at a target from an eye, or along a direction from a distance at which all balls
// around the points are visible. An eye is chosen for a wide window: in a narrower one it
// moves back until the points are in sight, or as much of them as in the wide one. With `widened`
// all points are seen in any case.
function camera(command) {
  const {eye, direction, points, field_of_view: fov, widened} = command;
  const radius = Math.max(command.radius, girth());
  const center = vector(command.target), up = vector(command.up);
  const toEye = eye ? vector(eye).sub(center) : vector(direction);
  const distance = toEye.length();
  toEye.normalize();
  const {clientWidth, clientHeight} = viewer.dom_element, height = clientHeight || 640;
  const aspect = clientWidth / clientHeight || 1.5;
  const tall = Math.tan(fov * Math.PI / 360), wide = tall * aspect;
  const bar = Math.max(BAR, barHeight / height), title = Math.max(TITLE, legend.covered / height);
  const right = up.clone().cross(toEye).normalize(), above = toEye.clone().cross(right);
  const offsets = points.map((point) => vector(point).sub(center));
  const needed = (offset) => {
    const x = Math.abs(offset.dot(right)) + radius, y = Math.abs(offset.dot(above)) + radius;
    const across = x / wide, upwards = eye && !widened ? 0 : y / (tall * (1 - bar - title));
    return offset.dot(toEye) + Math.max(across, upwards);
  };
  let away = Math.max(...offsets.map(needed));
  const farthest = widened ? Infinity : distance * Math.max(WIDE / aspect, 1);
  if (eye) away = clamp(away, distance, farthest);
  const lens = viewer.camera;
  Object.assign(lens, {fov, near: away / 100, far: away * 100});
  lens.up.copy(up);
  lens.position.copy(center).addScaledVector(toEye, away);
  // To the right, to be beside the legend if there is space; the picture is 2 wide.
  const ends = (side) => offsets.map((offset) =>
    (offset.dot(right) + side * radius) / (wide * (away - offset.dot(toEye))));
  const edge = 2 * legend.reach / (clientWidth || Infinity) - 1;
  const shift = Math.max(Math.min(edge - Math.min(...ends(-1)), 1 - Math.max(...ends(1))), 0);
  lens.setViewOffset(1, 1, -shift / 2, (bar - title) / 2, 1, 1);
  viewer.set_3d_pane_size();
  viewer.controls.dispose();
  viewer.set_camera(lens);  // new controls, which orbit about the new up direction
  viewer.controls.target.copy(center);
  placed = {command, position: lens.position.clone(), target: center, slack: 1e-9 * away};
}

// The camera goes along with the tool, if it is to; also one that the user has turned.
function followTool() {
  const way = views.moved();
  if (!way) return;
  for (const point of [viewer.camera.position, viewer.controls.target,
                       placed.position, placed.target]) point.add(way);
}

function untouched() {
  const near = (one, other) => one.distanceTo(other) < placed.slack;
  return placed !== null && near(viewer.camera.position, placed.position)
    && near(viewer.controls.target, placed.target);
}

// Place the camera again for another size of the window, unless the user has moved it.
function refit() {
  viewer.set_3d_pane_size();
  if (untouched()) views.place();
  viewer.set_dirty();
}

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
    meshcat(withFiles(command));
  } finally {
    BufferGeometry.prototype.applyMatrix4 = apply;
  }
  node(command.path).traverse((object) => {
    object.geometry &&= shared(object.geometry);
    const {geometry, material} = object;
    if (geometry?.userData.mergedUserData && Array.isArray(material)) assignMaterials(object);
    // Without normals, a mesh would be black.
    if (geometry?.isBufferGeometry && !geometry.attributes.normal) geometry.computeVertexNormals();
    if (material) object.material = Array.isArray(object.material)
      ? object.material.map(lit) : lit(object.material);
    if (drawsLightly) simplify(object);
  });
}

// The content of mesh files, which come once each; objects name them.
const meshFiles = new Map();

function withFiles(command) {
  const fill = (owner) => {
    Object.assign(owner, meshFiles.get(owner.file));
    owner.children?.forEach(fill);
  };
  const {geometries = [], object} = command.object;
  [...geometries, object].forEach(fill);
  return command;
}

// One geometry for all meshes of a name, in whichever robot or run: its normals are computed once, and
// the graphics card has it once.
const geometries = new Map();

function shared(geometry) {
  const {name} = geometry;
  if (!name) return geometry;
  if (!geometries.has(name)) geometries.set(name, geometry);
  return geometries.get(name);
}

// A material, lit as all others are.
function lit(material) {
  if (!material.isMeshPhongMaterial && !material.isMeshLambertMaterial) return material;
  const {color, map = null, opacity, transparent, side} = material;
  const look = {color, map, opacity, transparent, side, roughness: 0.5};
  return new MeshCat.THREE.MeshStandardMaterial(look);
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
