// The page around the scene of `hsp play`: the bar below it, the panel beside it, and the labels
// over it in pixels.

class PlayBar {
  constructor(play) {
    this.play = play;
    this.row = part(".play-bar");
    const names = ["toggle", "panel", "clock", "rate"];
    [this.toggle, this.panel, this.clock, this.rate] =
      names.map((name) => part(`.${name}`, this.row));
    const actions = ["step", "reset", "save", "page", "stop"];
    this.acting = [onPress(this.toggle, () => play.toggle()), ...actions.map((name) =>
      onPress(part(`.${name}`, this.row), () => play.act(name)))];
    [this.status, this.watching] = [".play-status", ".play-watching"].map((name) => part(name));
    onPress(this.panel, () => play.panel.setOpen(!play.panel.open));
    onPress(part("button", this.watching), () => play.act("take_over"));
    this.other = part(".other", this.row);
    this.preview = part(".preview", this.row);
    this.acting.push(onPress(this.preview, () => play.togglePreview()));
    this.acting.push(onPress(this.other, () => play.compareNext()));
    presentation.addButton(part(".present", this.row));
    this.past = new PlayPast(play, part(".back", this.row));
    const camera = new PlayCamera(play.viewer, () => document.title);
    onPress(part(".picture", this.row), () => camera.picture());
    const film = part(".film", this.row);
    film.hidden = !window.MediaRecorder;
    onPress(film, () => { film.ariaPressed = camera.film(); });
  }

  // Show a message for a while, until the program reports one.
  notify(words) {
    this.status.textContent = words;
    this.timer = setTimeout(() => { this.status.textContent = ""; }, 8000);
  }

  showState({t, running, rate, message, level}) {
    if (!this.past.looking) this.clock.textContent = `${t.toFixed(2)} s`;
    this.rate.replaceChildren(...running
      ? [`${Number(rate).toFixed(2)} ×`, make("span", {}, " real time")]
      : [this.play.simulated ? "paused" : "stopped"]);
    const ariaLabel = running ? "Pause" : "Go";
    Object.assign(this.toggle, {ariaLabel, title: `${ariaLabel} (space)`});
    if ((this.reported ?? "") !== message) {
      this.reported = this.status.textContent = message;
      clearTimeout(this.timer);
      // A report disappears after a while; a warning stays.
      if (level !== "warning") this.timer = setTimeout(() => { this.status.textContent = ""; }, 6000);
    }
    this.status.classList.toggle("warning", level === "warning");
  }

  showLaws(laws, law) {
    this.other.hidden = !laws.length;
    this.other.ariaPressed = Boolean(law);
    const title = law ? `The ghost: ${law}` : "Compare with the other law, a ghost";
    if (this.other.title !== `${title} (o)`) this.other.title = `${title} (o)`;
  }

  showDrive(mine, taken) {
    this.watching.hidden = mine;
    part("span", this.watching).textContent = taken ? "another page" : "no page";
    for (const button of this.acting) button.disabled = !mine;
  }
}

// The dead-man's key of a live loop: the robot moves only while the space bar, or this button, is
// held. The page repeats a message while it is held; the loop stops the robot when none arrives.
class PlayHold {
  constructor(play) {
    Object.assign(this, {play, held: false, button: part(".play-bar .hold")});
    this.button.hidden = false;
    on(this.button, "pointerdown", ({pointerId}) => {
      this.button.setPointerCapture(pointerId);
      this.set(true);
    });
    on(this.button, "pointerup pointercancel lostpointercapture", () => this.set(false));
    on(this.button, "contextmenu", (event) => event.preventDefault());
    whenAway(() => this.set(false));
  }

  set(held) {
    if (held === this.held) return;
    this.held = this.button.ariaPressed = held;
    clearInterval(this.timer);
    const report = () => this.play.send({do: "hold", held});
    report();
    if (held) this.timer = setInterval(report, 50);  // ms; the loop waits for 500
  }
}

// The panel: switches, live plots, the other controls in their groups. A change is sent, and the value
// that the program then reports, with each picture, is shown: a refused one goes back. While a
// slider is held, and a moment after each change, older values from the program are ignored.
class PlayPanel {
  static PATIENCE = 5000;  // ms; a program that draws slowly confirms late
  static NARROW = "(max-width: 620px), (max-width: 860px) and (max-aspect-ratio: 6/5)";

  constructor(play) {
    Object.assign(this, {play, open: false, narrow: matchMedia(PlayPanel.NARROW)});
    this.box = part(".play-panel");
    this.plots = part(".play-plots");
    this.fields = [...this.box.querySelectorAll("fieldset")];  // switches and settings
    onPress(part(".close", this.box), () => this.setOpen(false));
    // On a phone there is room for the sheet or the legend.
    on(legend.toggle, "click", () => { if (legend.open && this.narrow.matches) this.setOpen(false); });
  }

  setOpen(open) {
    const {panel} = this.play.bar;
    this.open = open;
    if (open && this.narrow.matches) legend.setOpen(false);
    this.box.inert = !open;
    document.body.classList.toggle("with-panel", open);
    panel.ariaPressed = panel.ariaExpanded = open;
  }

  build({controls}, gizmos) {
    part("h2", this.box).textContent = "Controls and plots";  // the title is above the scene
    this.setters = new Map();
    this.wanted = new Map();  // setting -> [value, when], until the program confirms it
    this.things = new Map(gizmos.map((gizmo) => [gizmo.key, this.thing(gizmo)]));
    const {switch: switches = [], slider: sliders = []} = Object.groupBy(controls, ({kind}) => kind);
    const rows = [...gizmos.map(({key, noun}) => [`${noun}s`, this.things.get(key)]),
                  ...sliders.map((each) => [each.group || "Settings", this.slider(each)])];
    const groups = [...Map.groupBy(rows, ([group]) => group)];
    this.fields[0].replaceChildren(...switches.map((each) => this.switch(each)));
    this.fields[1].replaceChildren(...groups.map(([name, own]) =>
      make("section", {}, make("h3", {}, name), ...own.map(([, row]) => row))));
  }

  // The name of a target or an obstacle, which selects it, and the way back to its own path.
  thing(gizmo) {
    const {play} = this, {name, kind, color} = gizmo.target;
    const select = makeButton({className: "select", ariaLabel: `Select ${name}`}, () => {
      play.overlay.buttons.get(gizmo.key).focus();
      if (this.narrow.matches) this.setOpen(false);
    }, make("i", {style: color ? `background: ${color}` : ""}), make("span", {}, name),
    make("small", {}, kind ?? ""));
    const resume = makeButton({className: "resume", ariaLabel: `${name}: back to its own path`},
                              () => play.resume(gizmo), "Back to its path");
    return make("div", {className: "play-row target"}, select, resume);
  }

  showMoved(key, moved) { this.things.get(key).classList.toggle("moved", moved); }

  showSelected(selected) {
    for (const [key, row] of this.things) row.classList.toggle("selected", key === selected);
  }

  slider(control) {
    const {id, unit, value, low, high, log} = control;
    const input = make("input", {type: "range", min: 0, max: 1, step: 0.005, id: `play-${id}`});
    const shown = make("output");
    const place = (x) => log ? Math.log(x / low) / Math.log(high / low) : (x - low) / (high - low);
    const valueAt = (share) => log ? low * (high / low) ** share : low + share * (high - low);
    const short = (x) => Number(x.toPrecision(3));  // enough to set a gain
    const show = (x) => {
      const words = [Plot.minus(String(short(x))), unit === "–" ? "" : unit].join(" ");
      shown.textContent = input.ariaValueText = words.trim();
      Object.assign(input, {ariaValueNow: short(x), ariaValueMin: low, ariaValueMax: high});
      input.style.setProperty("--share", `${100 * clamp(place(x), 0, 1)}%`);
    };
    on(input, "input", () => {
      const next = clamp(short(valueAt(Number(input.value))), low, high);
      show(next);
      this.set(id, next);
    });
    this.setters.set(id, (x) => {
      if (input.matches(":active")) return;
      input.value = place(x);
      show(x);
    });
    this.setters.get(id)(value);
    return PlayPanel.row(control, input, shown);
  }

  switch(control) {
    const {id, value} = control;
    const input = make("input", {type: "checkbox", role: "switch", checked: value, id: `play-${id}`});
    on(input, "change", () => this.set(id, input.checked));
    this.setters.set(id, (checked) => { input.checked = checked; });
    return PlayPanel.row(control, input);
  }

  static row({kind, label, note}, input, ...shown) {
    const name = make("span", {}, label, make("small", {}, note ?? ""));
    return make("div", {className: `play-row ${kind}`},
                make("label", {htmlFor: input.id}, name, ...shown), input);
  }

  set(id, value) {
    const key = `set ${id}`;
    this.play.touch(key);
    this.wanted.set(id, [value, performance.now()]);
    this.play.sendLater(key, {do: "set", id, value});
  }

  // Show the program's values, once it has confirmed or refused the last change.
  setValues(values) {
    const refused = this.play.state.level === "warning";
    for (const [id, value] of Object.entries(values)) {
      if (!this.play.isFresh(`set ${id}`)) continue;
      const [wanted, since] = this.wanted.get(id) ?? [value, 0];
      const same = wanted === value || Math.abs(wanted - value) <= 1e-6 * Math.abs(wanted);
      if (!same && !refused && performance.now() - since < PlayPanel.PATIENCE) continue;
      this.wanted.delete(id);
      this.setters.get(id)?.(value);
    }
  }
}

// The poses of the last ten seconds, and the slider that looks back at them. The picture is then
// the past, targets and obstacles too, and none can be dragged: a simulation pauses, a live loop
// goes on.
class PlayPast {
  static SPAN = 10;  // s

  constructor(play, input) {
    Object.assign(this, {play, input, poses: [], last: null, places: new Map(), began: false});
    on(input, "input", () => this.look());
  }

  get looking() { return Number(this.input.value) < 0; }

  // Keep the drawn poses; return whether they are to be shown.
  take(tracks) {
    this.last = tracks;
    return !this.looking;
  }

  // Keep where targets and obstacles are; return whether they are to be shown there.
  takePlaces(places) {
    this.places = new Map([...this.places, ...places]);
    return !this.looking;
  }

  // The time of the last pose.
  mark(t, running) {
    if (t < (this.poses.at(-1)?.t ?? t)) this.poses = [];  // it has begun anew
    if (this.last && t > (this.poses.at(-1)?.t ?? -1)) {
      this.poses.push({t, tracks: this.last, places: this.places});
    }
    const old = this.poses.findIndex((pose) => pose.t > t - PlayPast.SPAN);
    if (old > 50) this.poses.splice(0, old);
    const goes = running && this.paused && this.play.isFresh("back");  // no older message
    if (this.looking && goes && this.play.simulated) this.leave();
    this.paused = !running;
  }

  look() {
    const {play} = this, end = this.poses.at(-1)?.t;
    if (end === undefined) return;
    const begins = this.looking && !this.began;
    this.began = this.looking;
    play.touch("back");
    if (play.simulated && (begins || play.state.running)) play.act("pause");
    const wanted = end + Number(this.input.value);
    const pose = this.poses.findLast(({t}) => t <= wanted) ?? this.poses[0];
    player.pose(pose.tracks);
    for (const [key, place] of this.looking ? pose.places : this.places) {
      play.gizmos.get(key)?.setPose(place);
    }
    play.bar.clock.textContent = `${pose.t.toFixed(2)} s`;
    play.viewer.set_dirty();
  }

  leave() {
    this.input.value = 0;
    this.began = false;
  }
}

// Each joint's position within its range, and its speed and effort relative to their limits.
class PlayBars {
  static NEAR = 0.95;  // of a limit: the bar is marked

  constructor(box) { this.box = box; }

  build(names) {
    this.box.hidden = !names.length;
    this.rows = names.map((name) => ["q", "v", "τ"].map((what) =>
      make("i", {className: what === "q" ? "position" : "", title: `${what} of ${name}`})));
    const short = PlayBars.short(names);
    const cells = names.flatMap((name, k) =>
      [make("span", {title: name}, short[k]), ...this.rows[k].map((bar) => make("b", {}, bar))]);
    const heads = ["", "q", "v", "τ"].map((text) => make("small", {}, text));
    part("div", this.box).replaceChildren(...heads, ...cells);
  }

  // Names without the words that all share: there is little space.
  static short(names) {
    const words = names.map((name) => name.split("_"));
    const own = (word) => !words.every((others) => others.includes(word));
    const found = words.map((each) => each.filter(own).join("_"));
    return found.every(Boolean) ? found : names;
  }

  show({q, v, tau}) {
    this.rows?.forEach(([position, speed, effort], k) => {
      const share = q[k] === null ? null : clamp(q[k], 0, 1);
      position.hidden = share === null;
      position.style.left = `${100 * share}%`;
      position.classList.toggle("near", Math.abs(2 * share - 1) > PlayBars.NEAR);
      [[speed, v[k]], [effort, tau[k]]].forEach(([bar, value]) => {
        const size = 50 * Math.min(Math.abs(value ?? 0), 1);
        Object.assign(bar.style, {left: `${value < 0 ? 50 - size : 50}%`, width: `${size}%`});
        bar.classList.toggle("near", Math.abs(value) > PlayBars.NEAR);
      });
    });
  }
}

// The picture as a file, and a film of the page from now on.
class PlayCamera {
  constructor(viewer, title) { Object.assign(this, {viewer, title, recorder: null}); }

  get canvas() { return this.viewer.renderer.domElement; }

  picture() {
    this.viewer.render();  // in the same task: later the picture is gone
    this.canvas.toBlob((blob) => this.save(blob, "png"));
  }

  // Start a film, or stop and save it; return whether one is being recorded.
  film() {
    if (this.recorder) {
      this.recorder.stop();
      return false;
    }
    const pieces = [], types = ["video/webm;codecs=vp9", "video/webm", "video/mp4"];
    const mimeType = types.find((type) => window.MediaRecorder?.isTypeSupported(type));
    if (!mimeType) return false;
    this.recorder = new MediaRecorder(this.canvas.captureStream(30), {mimeType,
                                                                      videoBitsPerSecond: 12e6});
    this.recorder.ondataavailable = ({data}) => pieces.push(data);
    this.recorder.onstop = () => {
      this.recorder = null;
      this.save(new Blob(pieces, {type: mimeType}), mimeType.includes("mp4") ? "mp4" : "webm");
    };
    this.recorder.start();
    return true;
  }

  save(blob, ending) {
    const words = this.title().replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "");
    const link = make("a", {href: URL.createObjectURL(blob),
                            download: `${words.slice(0, 60) || "picture"}.${ending}`});
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
  }
}

// Over the scene: the name of the selected or dragged thing, and the spring by which a link is pulled;
// and an invisible button at each target and obstacle, for the Tab key and screen readers.
class PlayOverlay {
  constructor() {
    this.spring = part(".spring");
    this.force = part(".play-label.force");
  }

  setThings(gizmos, select) {
    this.buttons = new Map(gizmos.map(({key, noun, target}, k) => {
      const number = k < 9 ? `, key ${k + 1}` : "";
      const ariaLabel = `${noun} ${target.name}${number}: arrow keys and page up, page down move it`;
      return [key, make("button", {type: "button", ariaLabel, onfocus: () => select(key)})];
    }));
    this.labels = new Map(gizmos.map(({key}) => [key, make("div", {className: "play-label name"})]));
    part(".play-handles").replaceChildren(...this.buttons.values(), ...this.labels.values());
  }

  // Put a gizmo's button at its place, and its text above its radius [px].
  place(key, {x, y, ahead}, radius, text, away) {
    const label = this.labels.get(key);
    label.hidden = !ahead || !text;
    label.classList.toggle("away", away);
    if (ahead) {
      this.buttons.get(key).style.transform = `translate(${x.toFixed(0)}px, ${y.toFixed(0)}px)`;
    }
    if (label.hidden) return;
    label.textContent = text;
    PlayOverlay.put(label, x, y - radius - 12);
  }

  // A spring between two pixels with its force [N]; null hides it.
  showSpring(from, to, newtons) {
    const visible = Boolean(from?.ahead && to?.ahead);
    this.spring.style.display = visible ? "" : "none";
    this.force.hidden = !visible || newtons === null;
    if (!visible) return;
    const [coil, ...ends] = this.spring.children, [dx, dy] = [to.x - from.x, to.y - from.y];
    const length = Math.hypot(dx, dy), angle = Math.atan2(dy, dx) * 180 / Math.PI;
    const height = Math.max(2, Math.min(7, 900 / (length + 60), 0.2 * length));
    const at = ({x, y}) => `translate(${x} ${y})`;
    coil.setAttribute("transform", `${at(from)} rotate(${angle}) scale(${length} ${height})`);
    [from, to].forEach((end, k) => ends[k].setAttribute("transform", at(end)));
    if (newtons === null) return;
    this.force.textContent = `${newtons < 10 ? newtons.toFixed(1) : newtons.toFixed(0)} N`;
    PlayOverlay.put(this.force, to.x, to.y - 18);
  }

  // Centre a label above a pixel, inside the window.
  static put(label, x, y) {
    const half = label.offsetWidth / 2 + 6, below = Math.max(y, label.offsetHeight + 6);
    const inside = clamp(x, half, innerWidth - half);
    label.style.transform = `translate(${inside.toFixed(1)}px, ${below.toFixed(1)}px) `
      + "translate(-50%, -100%)";
  }
}
