// `hsp play` in the page: a running controller whose targets, obstacles, links and settings are moved
// by hand. The program describes itself by "play_setup" and then reports by the other "play_..."
// commands; see the end. The page that steers answers over the scene's websocket with JSON:
// {"do": "move", ...}.
"use strict";

class Play {
  static ECHO = 400;  // ms: after a release or a change, the program's older values are not shown

  constructor(viewer) {
    Object.assign(this, {viewer, sight: new Sight(viewer), mine: true, holdKey: null, taken: false});
    this.pending = new Map();  // messages of the next frame, the newest of each kind
    this.gizmos = new Map();  // key -> Gizmo, of a target or an obstacle
    this.touched = new Map();  // key of a thing or a setting -> when the hand has changed it [ms]
    this.state = {t: 0, running: true, rate: 1, message: "", level: "info"};
    this.laws = [];  // with which it can be compared
    this.law = "";  // which one is; "": none
    this.ghosts = new Ghosts(viewer);
    this.away = {};  // task -> label of a target that is not reached
    this.setup = this.selected = this.force = this.pull = null;
  }

  get ready() { return this.setup !== null; }
  // Whether it is a simulation, which can be paused; else it is a live loop.
  get simulated() { return this.setup.loop === "simulated"; }

  setUp(setup) {
    const {targets, obstacles, plots, loop} = setup;
    if (!this.ready) this.build();
    this.setup = setup;
    this.hand.end(true);
    this.ghosts.clear();
    document.body.classList.toggle("live-loop", !this.simulated);
    document.body.classList.toggle("watched-loop", loop === "watched");
    if (loop === "held") this.holdKey ??= new PlayHold(this);
    this.touched.clear();
    this.force = null;
    for (const gizmo of this.gizmos.values()) gizmo.dispose();
    const alone = obstacles.length === 1;
    const gizmos = [...targets.map((each) => new Gizmo(each, this.viewer)),
                    ...obstacles.map((each) => new Obstacle(each, this.viewer, alone))];
    this.gizmos = new Map(gizmos.map((gizmo) => [gizmo.key, gizmo]));
    this.overlay.setThings(gizmos, (key) => this.select(key));
    this.panel.build(setup, gizmos);
    this.bars.build(setup.joints ?? []);
    this.setUpPlots(plots);
    this.select(this.gizmos.has(this.selected) ? this.selected : null);
    this.showDrive();
    this.bar.showState(this.state);
  }

  build() {
    document.body.classList.add("play");
    document.body.append(part("#play-parts").content);
    this.overlay = new PlayOverlay();
    this.bar = new PlayBar(this);
    this.panel = new PlayPanel(this);
    this.bars = new PlayBars(part(".play-joints"));
    this.hand = new PlayHand(this, this.viewer);
    this.keys = new PlayKeys(this);
    this.viewer.scene.onBeforeRender = () => this.layOut();
    new ResizeObserver(() => this.leaveRoom()).observe(this.bar.row);
    legend.keepClosed = true;  // the whole scene can be dragged
    legend.setOpen(false);
    this.panel.setOpen(!this.panel.narrow.matches);
    if (this.lighten()) {
      this.bar.notify("No graphics card is used: shadows and reflections are off.");
    }
    refit();  // there is no legend to make room for
  }

  // Draw lightly without a graphics card; return whether it does. A page whose address has "full"
  // draws everything all the same: for pictures.
  lighten() {
    this.light ??= isSoftware() && !new URLSearchParams(location.search).has("full");
    if (this.light && !drawsLightly) drawLightly();
    return this.light;
  }

  // The picture has room for the part that the bar covers.
  leaveRoom() {
    const {bottom} = this.viewer.dom_element.getBoundingClientRect();
    barHeight = Math.max(0, bottom - this.bar.row.getBoundingClientRect().top);
    refit();
  }

  // After a reset the plots are the same: they keep the curve that is shown alone.
  setUpPlots(definitions) {
    const text = JSON.stringify(definitions);
    if (text === this.plotsText) return this.plots.clear();
    this.plots?.dispose();
    this.plotsText = text;
    this.plots = new LivePlots(this.panel.plots, definitions, () => this.panel.open);
  }

  showTargets({poses = {}, obstacles = {}, away = {}}) {
    this.away = away;
    const keyed = (noun, things) =>
      Object.entries(things).map(([name, pose]) => [`${noun} ${name}`, pose]);
    const places = new Map([...keyed("target", poses), ...keyed("obstacle", obstacles)]);
    if (this.bar.past.takePlaces(places)) this.showPlaces(places);
  }

  showPlaces(places) { for (const [key, pose] of places) this.showAt(key, pose); }

  // Show a thing where the program has it, unless it is being dragged.
  showAt(key, pose) {
    const {grip} = this.hand, held = grip?.moved && grip.key === key;
    if (!held && this.isFresh(key)) this.gizmos.get(key)?.setPose(pose);
  }

  // Whether the program's value of a thing or a setting is newer than the user's change.
  isFresh(key) { return !(performance.now() < this.touched.get(key) + Play.ECHO); }
  touch(key) { this.touched.set(key, performance.now()); }

  showState(state) {
    Object.assign(this.state, state);
    this.bar?.showState(this.state);
    this.bar?.past.mark(this.state.t, this.state.running);
  }

  setDrive({mine, taken}) {
    Object.assign(this, {mine, taken});
    if (!this.ready) return;
    if (!mine) {
      this.pending.clear();
      this.hand.end(true);
      this.keys.moving.clear();
      this.holdKey?.set(false);
    }
    this.showDrive();
  }

  showDrive() {
    this.bar.showDrive(this.mine, this.taken);
    for (const field of this.panel.fields) field.disabled = !this.mine;
    document.body.classList.toggle("watching", !this.mine);
    this.showMarks();
  }

  // Send a message to the program, after the pending ones.
  send(message) {
    this.flush();
    const connected = this.viewer.connection?.readyState === WebSocket.OPEN;
    if (connected && (this.mine || message.do === "take_over")) {
      this.viewer.connection.send(JSON.stringify(message));
    }
  }

  // Send it with the next frame; a newer message with its key replaces it.
  sendLater(key, message) {
    if (!this.pending.size) requestAnimationFrame(() => this.flush());
    this.pending.set(key, message);
  }

  flush() {
    const messages = [...this.pending.values()];
    this.pending.clear();
    for (const message of messages) this.send(message);
  }

  move(gizmo) {
    this.hold(gizmo.key);
    this.sendLater(gizmo.key, gizmo.wish());
  }

  release(gizmo) {
    this.hold(gizmo.key);
    this.send({do: "release", ...gizmo.address()});
  }

  resume(gizmo) {
    this.touched.delete(gizmo.key);
    this.panel.showMoved(gizmo.key, false);
    this.send({do: "resume", ...gizmo.address()});
  }

  pullLink({path, point, local}, to) {
    this.pull = {path, local, to};
    this.sendLater("pull", {do: "pull", path, point: point.toArray(), to: to.toArray()});
  }

  letGo() {
    this.pull = this.force = null;
    this.send({do: "let_go"});
  }

  // For a moment, show a thing where the user has put it.
  hold(key) {
    this.touch(key);
    this.panel.showMoved(key, true);
    this.viewer.set_dirty();
  }

  act(what) { this.send({do: what}); }
  toggle() { this.act(this.state.running ? "pause" : "go"); }

  // Compare with the next law; after the last one with none.
  compareNext() {
    const law = this.laws[this.laws.indexOf(this.law) + 1] ?? "";
    this.send({do: "compare", law});
  }

  // Switch the preview of self-motion on or off.
  togglePreview() { this.send({do: "preview", on: !this.previewed}); }

  showPreview({on}) {
    this.previewed = on;
    this.bar.preview.ariaPressed = on;
  }

  showLaws({laws, law}) {
    Object.assign(this, {laws, law});
    this.bar.showLaws(laws, law);
  }

  select(key) {
    this.selected = key;
    this.panel.showSelected(key);
    this.showMarks();
  }

  showMarks() {
    const {grip, hover} = this.hand;
    for (const gizmo of this.gizmos.values()) {
      const active = [grip, hover].find((found) => found?.gizmo === gizmo);
      gizmo.mark(active?.handle, Boolean(grip), !this.mine, gizmo.key === this.selected);
    }
    this.viewer.set_dirty();
  }

  // Before each picture: fit handles and labels to the camera.
  layOut() {
    const sight = this.sight.update();
    const {grip, hover} = this.hand, active = grip ? grip.key : hover?.key ?? this.selected;
    for (const [key, gizmo] of this.gizmos) {
      gizmo.layOut(sight);
      const {name} = gizmo.target, away = gizmo.noun === "Target" ? this.away[name] : "";
      const lines = [away, key === active && (grip?.text ? `${name}   ${grip.text}` : name)];
      const at = sight.project(gizmo.position), radius = gizmo.ball * gizmo.enlarged + 9;
      this.overlay.place(key, at, radius, lines.filter(Boolean).join("\n"), Boolean(away));
    }
    this.layOutSpring(sight);
    this.ghosts.layOut(sight);
    this.keepInSight(sight);
  }

  // The camera moves back where a target comes to the edge of the picture, unless the user has
  // turned it.
  keepInSight(sight) {
    if (this.hand.grip || this.bar.past.looking) return;
    const {left, right, top, bottom, width, height} = sight.box;
    const edge = 0.08 * Math.min(width, height), low = bottom - barHeight;
    const within = (x, one, other) => x > one + edge && x < other - edge;
    const out = [...this.gizmos.values()].filter(({noun, position}) => {
      const {x, y, ahead} = sight.project(position);
      return noun === "Target" && !(ahead && within(x, left, right) && within(y, top, low));
    });
    if (out.length) requestAnimationFrame(() => views.widen(out.map(({position}) => position)));
  }

  // The hand's end of the spring is where the pointer is; the link's end moves with it.
  layOutSpring(sight) {
    const {pull, force} = this, {Vector3} = MeshCat.THREE;
    if (!pull && !force) return this.overlay.showSpring(null);
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
  play_state(command) { play.showState(command); },
  play_laws(command) { if (play.ready) play.showLaws(command); },
  play_preview(command) { if (play.ready) play.showPreview(command); },
  ghosts(command) { if (play.ready) play.ghosts.show(command); },
  play_values({values}) { if (play.ready) play.panel.setValues(values); },
  pose({tracks}) { if (!play.ready || play.bar.past.take(tracks)) player.pose(tracks); },
  play_joints(command) { if (play.ready && play.panel.open) play.bars.show(command); },
  play_force(command) { play.force = command.visible ? command : null; },
  play_samples({times, values}) { if (play.ready) play.plots.add(times, values); },
  play_drive(command) {
    play.lighten();  // before the scene comes: its first picture would take the longest
    play.setDrive(command);
  },
  lost() {
    play.setDrive({mine: false, taken: false});
    play.showState({running: false, message: ""});
  },
});
