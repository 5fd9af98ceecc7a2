// What is around the scene of `hsp play`: the bar below it, the panel beside it, and what is drawn
// over it in pixels.
"use strict";

// The bar: pause, step, reset, save, the time and the rate; above it the status line, and who
// steers the robot.
class PlayBar {
  static ICONS = {
    pause: "M7 5h3.6v14H7zM13.4 5H17v14h-3.6z",
    go: "M8 5v14l11-7z",
    step: "M6 5v14l9.6-7zM16.6 5H19v14h-2.4z",
    reset: "M12 5V1.6L6.6 6.2 12 10.8V7.4a5.4 5.4 0 1 1-5.4 5.4H4.2A7.8 7.8 0 1 0 12 5z",
    stop: "M6 6h12v12H6z",
    save: "M10.8 3.5h2.4v8.2l3-3 1.7 1.7L12 16.3 6.1 10.4l1.7-1.7 3 3zM4.5 18.1h15v2.4h-15z",
    panel: "M4 6.2h8.2a3 3 0 0 1 5.6 0H20v2h-2.2a3 3 0 0 1-5.6 0H4zM4 15.8h2.2a3 3 0 0 1 5.6 "
      + "0H20v2h-8.2a3 3 0 0 1-5.6 0H4z",
  };

  constructor(play, parent) {
    this.play = play;
    const button = (name, label, act, key = "") => makeButton(
      {className: name, ariaLabel: label, title: key ? `${label} (${key})` : label}, act,
      makeIcon(PlayBar.ICONS[name] ?? PlayBar.ICONS.pause));
    const acts = (name, label, key) => button(name, label, () => play.act(name), key);
    this.toggle = button("toggle", "Pause", () => play.toggle(), "space");
    this.acting = [this.toggle, acts("step", "One step", "."), acts("reset", "Reset", "r"),
                   acts("save", "Save the run", "s"), acts("stop", "Stop the robot")];
    this.panel = button("panel", "Controls and plots", () => play.panel.setOpen(!play.panel.open));
    this.clock = make("output", {className: "clock", ariaLabel: "Time"});
    this.rate = make("output", {className: "rate", ariaLabel: "Rate"});
    this.row = make("div", {className: "play-bar", role: "toolbar", ariaLabel: "Simulation"},
                    ...this.acting, this.clock, this.rate, this.panel);
    this.status = make("div", {className: "play-status", role: "status", hidden: true});
    this.who = make("span");
    this.watching = make("div", {className: "play-watching", hidden: true}, this.who,
                         makeButton({}, () => play.takeOver(), "Take over"));
    presentation.addButton(this.row);
    parent.append(make("div", {className: "play-foot"},
                       this.status, this.watching, this.row));
  }

  showState({t, running, rate, message, level}) {
    this.clock.textContent = `${t.toFixed(2)} s`;
    this.rate.replaceChildren(...running
      ? [`${Number(rate).toFixed(2)} ×`, make("span", {}, " real time")]
      : [this.play.simulated ? "paused" : "stopped"]);
    const label = running ? "Pause" : "Go";
    if (this.toggle.ariaLabel !== label) {
      Object.assign(this.toggle, {ariaLabel: label, title: `${label} (space)`});
      this.toggle.replaceChildren(makeIcon(PlayBar.ICONS[label.toLowerCase()]));
    }
    this.status.hidden = !message;
    if (this.status.textContent !== message) this.status.textContent = message;
    this.status.classList.toggle("warning", level === "warning");
  }

  showDrive(mine, taken) {
    this.watching.hidden = mine;
    this.who.textContent = `You are watching: ${taken ? "another page" : "nobody"} steers.`;
    for (const button of this.acting) button.disabled = !mine;
  }
}

// The dead-man's key of a live loop: the robot moves only while somebody holds the space bar, or
// this button. The page repeats that it is held; the loop stops the robot when it hears nothing,
// whatever the reason.
class PlayHold {
  static EVERY = 50;  // ms; the loop waits for 500

  constructor(play, bar) {
    Object.assign(this, {play, held: false});
    const title = "The robot moves while this, or the space bar, is held";
    this.button = make("button", {type: "button", className: "hold", title}, "Hold to run");
    bar.prepend(this.button);
    this.button.addEventListener("pointerdown", ({pointerId}) => {
      this.button.setPointerCapture(pointerId);
      this.set(true);
    });
    on(this.button, "pointerup pointercancel lostpointercapture", () => this.set(false));
    this.button.addEventListener("contextmenu", (event) => event.preventDefault());
    whenAway(() => this.set(false));
  }

  set(held) {
    if (held === this.held) return;
    this.held = held;
    this.button.ariaPressed = held;
    clearInterval(this.timer);
    const say = () => this.play.send({do: "hold", held});
    say();
    if (held) this.timer = setInterval(say, PlayHold.EVERY);
  }
}

// The panel: switches, live plots, the other controls in their groups. A value is the program's:
// a change is sent, and the value that the program then reports is shown, so a refused one goes
// back. While a slider is held, and a moment after each change, what the program said before does
// not count.
class PlayPanel {
  static NARROW = "(max-width: 620px), (max-width: 860px) and (max-aspect-ratio: 6/5)";
  static CLOSE = "M6.4 5 12 10.6 17.6 5 19 6.4 13.4 12l5.6 5.6-1.4 1.4-5.6-5.6L6.4 19 5 17.6l5.6"
    + "-5.6L5 6.4z";
  static HELP = `Drag a handle, an obstacle or a link; drag beside them to turn the view.
    <kbd>Tab</kbd> selects, <kbd>← → ↑ ↓</kbd> <kbd>Page ↑ ↓</kbd> move by 1 cm, with
    <kbd>Shift</kbd> by 1 mm. <span class="simulated"><kbd>Space</kbd> pauses, <kbd>.</kbd> steps,
    <kbd>R</kbd> resets, <kbd>S</kbd> saves.</span> <kbd>P</kbd> presents.`;

  constructor(play, parent) {
    Object.assign(this, {play, open: false, narrow: matchMedia(PlayPanel.NARROW)});
    this.title = make("h2");
    this.fields = [1, 2].map(() => make("fieldset", {className: "play-controls"}));
    const [switches, controls] = this.fields;
    this.plots = make("div", {className: "play-plots"});
    const close = makeButton({ariaLabel: "Close the panel", title: "Close"},
                             () => this.setOpen(false), makeIcon(PlayPanel.CLOSE));
    this.box = make("aside", {className: "play-panel", ariaLabel: "Controls and plots"},
      make("header", {}, this.title, close),
      make("div", {className: "play-content"}, switches, this.plots, controls,
           make("p", {className: "play-help", innerHTML: PlayPanel.HELP})));
    // On a phone there is room for the sheet or the legend.
    legend.toggle.addEventListener("click", () => {
      if (legend.open && this.narrow.matches) this.setOpen(false);
    });
    parent.append(this.box);
    this.setters = new Map();
    this.asked = new Map();  // id -> when the page has asked for a value [ms]
  }

  setOpen(open) {
    const {play} = this;
    this.open = open;
    if (open && this.narrow.matches) legend.setOpen(false);
    this.box.inert = !open;
    document.body.classList.toggle("with-panel", open);
    play.bar.panel.ariaPressed = play.bar.panel.ariaExpanded = open;
    play.fit();
  }

  build({title, targets, obstacles, controls}) {
    this.title.textContent = title || "Play";
    this.setters.clear();
    this.asked.clear();
    this.things = new Map();
    const groups = new Map();
    const put = (group, row) => groups.set(group, [...groups.get(group) ?? [], row]), switches = [];
    for (const one of targets) put("Targets", this.thing(Play.targetKey(one.name), one));
    for (const one of obstacles) {
      put("Obstacles", this.thing(Play.obstacleKey(one.name), {...one, color: Obstacle.COLOR}));
    }
    for (const control of controls) {
      if (control.kind === "switch") switches.push(this.switch(control));
      else put(control.group || "Settings", this.slider(control));
    }
    this.fields[0].replaceChildren(...switches);
    this.fields[1].replaceChildren(...[...groups].map(([name, rows]) =>
      make("section", {}, make("h3", {}, name), ...rows)));
  }

  // The name of a target or an obstacle, which selects it, and the way back to its own path.
  thing(key, {name, kind, color}) {
    const {play} = this;
    const select = makeButton({className: "select", ariaLabel: `Select ${name}`}, () => {
      play.overlay.buttons.get(key)?.focus();
      if (this.narrow.matches) this.setOpen(false);
    }, make("i", {style: color ? `background: ${color}` : ""}), make("span", {}, name),
    make("small", {}, kind ?? ""));
    const resume = makeButton({className: "resume", ariaLabel: `${name}: back to its own path`},
                              () => play.resume(key), "Back to its path");
    this.things.set(key, make("div", {className: "play-row target"}, select, resume));
    return this.things.get(key);
  }

  // Show that a thing was moved away from its path, or is on it again.
  showMoved(key, moved) { this.things.get(key)?.classList.toggle("moved", moved); }

  showSelected(selected) {
    for (const [key, row] of this.things) row.classList.toggle("selected", key === selected);
  }

  // The name of a control, and a line on what it does.
  static named(label, note) { return make("span", {}, label, make("small", {}, note ?? "")); }

  slider({id, label, note, unit, value, low, high, log}) {
    const input = make("input", {type: "range", min: 0, max: 1, step: 0.005, id: `play-${id}`});
    const shown = make("output");
    const place = (x) => log ? Math.log(x / low) / Math.log(high / low) : (x - low) / (high - low);
    const valueAt = (share) => log ? low * (high / low) ** share : low + share * (high - low);
    const show = (x, move = true) => {
      if (move) input.value = place(x);
      const words = `${PlayPanel.number(x)}${unit && unit !== "–" ? ` ${unit}` : ""}`;
      shown.textContent = input.ariaValueText = words;
      input.style.setProperty("--share", `${100 * clamp(place(x), 0, 1)}%`);
    };
    let held = false, reported = null;
    input.oninput = () => {
      // Three significant digits are enough to set a gain, and its ends are exact.
      const next = clamp(Number(valueAt(Number(input.value)).toPrecision(3)), low, high);
      reported = null;
      show(next, false);
      this.set(id, next);
    };
    input.onpointerdown = () => { held = true; };
    on(input, "pointerup pointercancel change blur", () => {
      held = false;
      if (reported !== null) show(reported);
    });
    this.setters.set(id, (x) => {
      reported = x;
      if (!held) show(x);
    });
    show(value);
    const name = make("label", {htmlFor: input.id}, PlayPanel.named(label, note), shown);
    return make("div", {className: "play-row slider"}, name, input);
  }

  switch({id, label, note, value}) {
    const input = make("input", {type: "checkbox", role: "switch", checked: value});
    input.onchange = () => this.set(id, input.checked);
    this.setters.set(id, (on) => { input.checked = on; });
    return make("div", {className: "play-row switch"},
                make("label", {}, PlayPanel.named(label, note), input));
  }

  // Ask for a value; what the program said before it heard of it is not shown.
  set(id, value) {
    this.asked.set(id, performance.now());
    this.play.sendLater(`set ${id}`, {do: "set", id, value});
  }

  setValues(values) {
    for (const [id, value] of Object.entries(values)) {
      const fresh = !(performance.now() < this.asked.get(id) + Play.ECHO);
      if (fresh) this.setters.get(id)?.(value);
    }
  }

  static number(value) {
    const text = value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5)
      ? value.toExponential(1) : String(Number(value.toPrecision(3)));
    return Plot.minus(text);
  }
}

// Over the scene: the name of what is selected or dragged, and the spring by which a link is pulled. It also holds one invisible button per target and obstacle, at its
// place, so that the Tab key and screen readers find them.
class PlayOverlay {
  constructor(parent) {
    this.box = make("div", {className: "play-overlay", innerHTML: `<div class="play-handles"></div>
      <svg aria-hidden="true"><g class="spring"><path class="halo"/><path class="coil"/><circle class="from" r="4"/>
        <circle class="to" r="7"/></g></svg>
      <div class="play-label force" role="status"></div>`});
    [this.handles, this.spring, this.force] =
      [".play-handles", ".spring", ".force"].map((s) => this.box.querySelector(s));
    parent.append(this.box);
    this.buttons = this.labels = new Map();
  }

  // One button per gizmo; select(key) is called when one gets the focus.
  setThings(gizmos, select) {
    this.buttons = new Map(gizmos.map(({key, label}, k) => {
      const number = k < 9 ? `, key ${k + 1}` : "";
      const ariaLabel = `${label}${number}: arrow keys and page up, page down move it`;
      return [key, make("button", {type: "button", ariaLabel, onfocus: () => select(key)})];
    }));
    for (const label of this.labels.values()) label.remove();
    this.labels = new Map(gizmos.map(({key}) => [key, make("div", {className: "play-label name"})]));
    this.box.append(...this.labels.values());
    this.handles.replaceChildren(...this.buttons.values());
  }

  // Put a gizmo's button at its place, and what there is to say above its radius [px].
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
    const [halo, coil, start, end] = this.spring.children;
    for (const line of [halo, coil]) PlayOverlay.set(line, {d: PlayOverlay.coil(from, to)});
    PlayOverlay.set(start, {cx: from.x, cy: from.y});
    PlayOverlay.set(end, {cx: to.x, cy: to.y});
    if (newtons === null) return;
    this.force.textContent = `${newtons < 10 ? newtons.toFixed(1) : newtons.toFixed(0)} N`;
    PlayOverlay.put(this.force, to.x, to.y - 18);
  }

  // The path of a coil spring: it becomes thinner as it is stretched.
  static coil(from, to) {
    const [dx, dy] = [to.x - from.x, to.y - from.y], length = Math.hypot(dx, dy) || 1;
    const [ux, uy] = [dx / length, dy / length], lead = Math.min(14, 0.2 * length), turns = 9;
    const height = Math.max(2, Math.min(7, 900 / (length + 60), 0.2 * length));
    const point = (along, across) => `${(from.x + along * ux - across * uy).toFixed(1)} `
      + `${(from.y + along * uy + across * ux).toFixed(1)}`;
    const wave = Array.from({length: 12 * turns + 1}, (_, k) => point(
      lead + (length - 2 * lead) * k / (12 * turns), height * Math.sin(Math.PI * k / 6)));
    return `M${[point(0, 0), ...wave, point(length, 0)].join("L")}`;
  }

  static set(element, attributes) {
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  }

  // Centre a label above a pixel, inside the window.
  static put(label, x, y) {
    const half = label.offsetWidth / 2 + 6;
    const inside = Math.min(Math.max(x, half), innerWidth - half);
    const below = Math.max(y, label.offsetHeight + 6);
    label.style.transform = `translate(${inside.toFixed(1)}px, ${below.toFixed(1)}px) `
      + "translate(-50%, -100%)";
  }
}
