// `hsp play` in the page: a running controller whose targets, obstacles, links and settings
// are moved by hand.
//
// The program describes itself by "play_setup" and then reports by the other "play_..."
// commands; see `handlers` at the end. The page answers over the scene's websocket with
// JSON: {"do": "move", ...}. Only the page that steers sends anything.
//
//   sight.js, drags.js, gizmos.js    what is where on the screen; the targets' handles
//   play_hand.js, play_keys.js       pointers and keys
//   play_overlay.js                  names, selection and spring over the scene
//   play_bar.js, play_panel.js       the bar, the panel
//   play_hold.js                     the dead-man's key of a live loop
//   live_plots.js                    the plots in the panel
"use strict";

// Messages to the program; repeated ones, such as moves, at most once a frame.
class PlayOutbox {
  constructor(viewer) {
    this.viewer = viewer;
    this.pending = new Map();
  }

  // Send a message with the next frame; a newer one of its key replaces it.
  later(key, message) {
    if (!this.pending.size) requestAnimationFrame(() => this.flush());
    this.pending.set(key, message);
  }

  flush() {
    const messages = [...this.pending.values()];
    this.pending.clear();
    messages.forEach((message) => this.now(message));
  }

  now(message) {
    if (this.pending.size) this.flush();
    const {connection} = this.viewer;
    if (connection?.readyState === WebSocket.OPEN) connection.send(JSON.stringify(message));
  }
}

class Play {
  static ECHO = 400;  // ms: after a release or a change, the program's older word is not shown

  constructor(viewer) {
    this.viewer = viewer;
    this.sight = new Sight(viewer);
    this.outbox = new PlayOutbox(viewer);
    this.gizmos = new Map();     // key -> Gizmo
    this.obstacles = new Map();  // key -> {name, path, at, radius}
    this.held = new Map();       // key -> until when its own place is shown [ms]
    this.mine = true;
    this.holdKey = null;
    this.taken = false;
    this.state = {t: 0, running: true, rate: 1, message: "", level: "info", away: ""};
    this.setup = this.selected = this.force = this.pull = null;
  }

  get ready() { return this.setup !== null; }

  // Whether it is a simulation, which can be paused; else it is a live loop.
  get simulated() { return this.setup.loop === "simulated"; }

  // --- what the program says ---

  setUp(setup) {
    const first = !this.ready;
    if (first) this.build();
    else this.hand.end(true);
    this.setup = setup;
    document.body.classList.toggle("live-loop", !this.simulated);
    if (setup.loop === "held") this.holdKey ??= new PlayHold(this, this.bar.row);
    this.held.clear();
    this.force = null;
    for (const gizmo of this.gizmos.values()) gizmo.dispose();
    this.gizmos.clear();
    this.obstacles.clear();
    for (const target of setup.targets ?? []) {
      this.gizmos.set(PlayHand.targetKey(target.name), new Gizmo(target, this.viewer.scene));
    }
    for (const {position, ...rest} of setup.obstacles ?? []) {
      const at = new MeshCat.THREE.Vector3(...position);
      this.obstacles.set(PlayHand.obstacleKey(rest.name), {...rest, at});
    }
    this.overlay.setThings(this.things(), (key) => this.select(key));
    this.panel.build({targets: [], obstacles: [], controls: [], ...setup});
    this.setUpPlots(setup.plots ?? []);
    if (!this.things().some(({key}) => key === this.selected)) this.selected = null;
    if (first) this.panel.setOpen(!this.panel.narrow.matches);
    this.select(this.selected);
    this.showDrive();
    this.bar.showState(this.state);
    this.fit();
  }

  build() {
    document.body.classList.add("play");
    this.overlay = new PlayOverlay(document.body);
    this.bar = new PlayBar(this, document.body);
    this.panel = new PlayPanel(this, document.body);
    this.hand = new PlayHand(this, this.viewer);
    this.keys = new PlayKeys(this);
    this.viewer.scene.onBeforeRender = () => this.layOut();
    addEventListener("resize", () => this.fit());
  }

  // On a phone the picture ends where the bar, or the open sheet, begins; the camera follows
  // the picture's size.
  fit() {
    const {panel, bar} = this;
    const sheet = panel.open ? panel.box.offsetHeight - 18 : 0;  // behind its round corners
    const height = Math.max(120, innerHeight - bar.row.offsetHeight - sheet);
    this.viewer.dom_element.style.height = panel.narrow.matches ? `${height}px` : "";
    layers.measure();
  }

  // After a reset the plots are the same: they keep what is shown alone.
  setUpPlots(definitions) {
    const text = JSON.stringify(definitions);
    if (this.plots && text === this.plotsText) return this.plots.clear();
    this.plots?.dispose();
    this.plotsText = text;
    this.plots = new LivePlots(this.panel.plots, definitions, () => this.panel.open);
  }

  showTargets({poses, obstacles}) {
    for (const [name, pose] of Object.entries(poses ?? {})) {
      const key = PlayHand.targetKey(name), gizmo = this.gizmos.get(key);
      if (gizmo && this.follows(key)) gizmo.setPose(pose);
    }
    for (const [name, place] of Object.entries(obstacles ?? {})) {
      const key = PlayHand.obstacleKey(name), obstacle = this.obstacles.get(key);
      if (obstacle && this.follows(key)) obstacle.at.set(...place);
    }
  }

  // Whether the program's word on where a thing is holds, not the hand's.
  follows(key) {
    const {grip} = this.hand;
    return !(grip?.moved && grip.key === key) && !(performance.now() < this.held.get(key));
  }

  showState(state) {
    Object.assign(this.state, state);
    this.bar?.showState(this.state);
  }

  setDrive({mine, taken}) {
    Object.assign(this, {mine, taken});
    if (!this.ready) return;
    if (!mine) {
      this.outbox.pending.clear();
      this.hand.end(true);
      this.keys.moving.clear();
      this.holdKey?.set(false);
    }
    this.showDrive();
  }

  showDrive() {
    this.bar.showDrive(this.mine, this.taken);
    this.panel.setDisabled(!this.mine);
    document.body.classList.toggle("watching", !this.mine);
    this.showMarks();
  }

  // --- what the hand does ---

  send(message) { if (this.mine) this.outbox.now(message); }

  sendLater(key, message) { if (this.mine) this.outbox.later(key, message); }

  moveTarget(gizmo) {
    const {name} = gizmo.target, key = PlayHand.targetKey(name);
    this.hold(key);
    this.panel.showMoved(key, true);
    this.sendLater(key, {do: "move", target: name, pose: gizmo.pose()});
  }

  moveObstacle(obstacle, to) {
    const key = PlayHand.obstacleKey(obstacle.name);
    obstacle.at.copy(to);
    this.hold(key);
    this.panel.showMoved(key, true);
    this.sendLater(key, {do: "obstacle", name: obstacle.name, position: to.toArray()});
  }

  release(name) {
    this.hold(PlayHand.targetKey(name));
    this.send({do: "release", target: name});
  }

  // Let a target or an obstacle return to its own path.
  resume(key, name) {
    this.held.delete(key);
    this.panel.showMoved(key, false);
    this.send({do: "resume", [this.gizmos.has(key) ? "target" : "name"]: name});
  }

  pullLink({path, point, local}, to) {
    this.pull = {path, local, to};
    this.sendLater("pull", {do: "pull", path, point: point.toArray(), to: to.toArray()});
  }

  letGo() {
    this.pull = this.force = null;
    this.send({do: "let_go"});
  }

  hold(key) {
    this.held.set(key, performance.now() + Play.ECHO);
    this.viewer.set_dirty();
  }

  set(id, value) { this.sendLater(`set ${id}`, {do: "set", id, value}); }

  act(what) { this.send({do: what}); }

  toggle() { this.act(this.state.running ? "pause" : "go"); }

  takeOver() { this.outbox.now({do: "take_over"}); }

  // --- what is shown ---

  // All that can be selected, in the order of the keys 1 to 9.
  things() {
    return [
      ...[...this.gizmos].map(([key, {target}]) => ({key, label: `Target ${target.name}`})),
      ...[...this.obstacles].map(([key, {name}]) => ({key, label: `Obstacle ${name}`})),
    ];
  }

  select(key) {
    this.selected = key;
    this.panel.showSelected(key);
    this.viewer.set_dirty();
  }

  showMarks() {
    const {grip, hover} = this.hand;
    for (const gizmo of this.gizmos.values()) {
      const active = [grip, hover].find((found) => found?.gizmo === gizmo);
      gizmo.mark(active?.handle, Boolean(grip), !this.mine);
    }
    this.viewer.set_dirty();
  }

  // Before each picture: fit handles and labels to the camera.
  layOut() {
    const sight = this.sight.update();
    for (const [key, gizmo] of this.gizmos) {
      gizmo.layOut(sight);
      this.overlay.placeButton(key, sight.project(gizmo.position));
    }
    for (const [key, {at}] of this.obstacles) {
      this.overlay.placeButton(key, sight.project(at));
    }
    this.layOutName(sight);
    this.layOutSpring(sight);
  }

  layOutName(sight) {
    const {grip, hover} = this.hand;
    const key = grip?.key ?? hover?.key ?? this.selected;
    const gizmo = this.gizmos.get(key), obstacle = this.obstacles.get(key);
    const thing = gizmo ?? obstacle;
    if (!thing || grip?.path) return this.overlay.showThing(null);
    const at = gizmo ? gizmo.position : obstacle.at;
    const radius = gizmo ? 17 * gizmo.enlarged
      : Math.max(obstacle.radius / sight.pixel(at) + 3, 12);
    const name = gizmo ? gizmo.target.name : obstacle.name;
    const text = grip?.text ? `${name}   ${grip.text}` : name;
    this.overlay.showThing(sight.project(at), radius, text, key === this.selected);
  }

  // The hand's end of the spring is where the pointer is; the link's end moves with it.
  layOutSpring(sight) {
    const {pull} = this, force = this.force;
    if (!pull && !force) return this.overlay.showSpring(null);
    const {Vector3} = MeshCat.THREE;
    const from = pull
      ? node(pull.path).localToWorld(pull.local.clone()).applyMatrix4(sight.toScene)
      : new Vector3(...force.from);
    const to = pull ? pull.to : new Vector3(...force.to);
    this.overlay.showSpring(sight.project(from), sight.project(to), force?.newtons ?? null);
  }
}

const play = new Play(viewer);

Object.assign(commandHandlers, {
  play_setup(command) { play.setUp(command); },
  play_targets(command) { if (play.ready) play.showTargets(command); },
  play_state({t, running, rate, message, level, away}) {
    play.showState({t, running, rate, message, level, away});
  },
  play_values({values}) { if (play.ready) play.panel.setValues(values); },
  play_force(command) { play.force = command.visible ? command : null; },
  play_samples({times, values}) { if (play.ready) play.plots.add(times, values); },
  play_drive(command) { play.setDrive(command); },
});
