// What is around the scene of `hsp play`: the bar below it, the panel beside it, and what is drawn
// over it in pixels.
"use strict";

// The bar: pause, step, reset, save, the time and the rate; above it the status line, and who
// steers the robot.
class PlayBar {
  constructor(play) {
    this.play = play;
    this.row = part(".play-bar");
    const names = ["toggle", "panel", "clock", "rate"];
    [this.toggle, this.panel, this.clock, this.rate] = names.map((name) => part(`.${name}`, this.row));
    const actions = ["step", "reset", "save", "stop"];
    this.acting = [onPress(this.toggle, () => play.toggle()), ...actions.map((name) =>
      onPress(part(`.${name}`, this.row), () => play.act(name)))];
    this.status = part(".play-status");
    this.watching = part(".play-watching");
    onPress(this.panel, () => play.panel.setOpen(!play.panel.open));
    onPress(part("button", this.watching), () => play.say({do: "take_over"}));
    presentation.addButton(part(".present", this.row));
  }

  showState({t, running, rate, message, level}) {
    this.clock.textContent = `${t.toFixed(2)} s`;
    this.rate.replaceChildren(...running
      ? [`${Number(rate).toFixed(2)} ×`, make("span", {}, " real time")]
      : [this.play.simulated ? "paused" : "stopped"]);
    const ariaLabel = running ? "Pause" : "Go";
    Object.assign(this.toggle, {ariaLabel, title: `${ariaLabel} (space)`});
    this.status.hidden = !message;
    if (this.status.textContent !== message) this.status.textContent = message;
    this.status.classList.toggle("warning", level === "warning");
  }

  showDrive(mine, taken) {
    this.watching.hidden = mine;
    part("span", this.watching).textContent = `You are watching: ${taken ? "another page" : "nobody"} steers.`;
    for (const button of this.acting) button.disabled = !mine;
  }
}

// The dead-man's key of a live loop: the robot moves only while somebody holds the space bar, or
// this button. The page repeats that it is held; the loop stops the robot when it hears nothing,
// whatever the reason.
class PlayHold {
  static EVERY = 50;  // ms; the loop waits for 500

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
    const say = () => this.play.send({do: "hold", held});
    say();
    if (held) this.timer = setInterval(say, PlayHold.EVERY);
  }
}

// The panel: switches, live plots, the other controls in their groups. A value is the program's:
// a change is sent, and the value that the program then reports, with each picture, is shown, so a
// refused one goes back. While a slider is held, and a moment after each change, what the program
// said before does not count.
class PlayPanel {
  static NARROW = "(max-width: 620px), (max-width: 860px) and (max-aspect-ratio: 6/5)";

  constructor(play) {
    Object.assign(this, {play, open: false, narrow: matchMedia(PlayPanel.NARROW)});
    this.box = part(".play-panel");
    this.plots = part(".play-plots");
    this.fields = [...this.box.querySelectorAll("fieldset")];  // switches and settings
    onPress(part(".close", this.box), () => this.setOpen(false));
    // On a phone there is room for the sheet or the legend.
    on(legend.toggle, "click", () => {
      if (legend.open && this.narrow.matches) this.setOpen(false);
    });
  }

  setOpen(open) {
    const {panel} = this.play.bar;
    this.open = open;
    if (open && this.narrow.matches) legend.setOpen(false);
    this.box.inert = !open;
    document.body.classList.toggle("with-panel", open);
    panel.ariaPressed = panel.ariaExpanded = open;
  }

  build({title, controls}, gizmos) {
    part("h2", this.box).textContent = title || "Play";
    this.setters = new Map();
    this.things = new Map(gizmos.map((gizmo) => [gizmo.key, this.thing(gizmo)]));
    const groups = new Map(), switches = [];
    const put = (group, row) => groups.set(group, [...groups.get(group) ?? [], row]);
    for (const gizmo of gizmos) put(`${gizmo.noun}s`, this.things.get(gizmo.key));
    for (const control of controls) {
      if (control.kind === "switch") switches.push(this.switch(control));
      else put(control.group || "Settings", this.slider(control));
    }
    this.fields[0].replaceChildren(...switches);
    this.fields[1].replaceChildren(...[...groups].map(([name, rows]) =>
      make("section", {}, make("h3", {}, name), ...rows)));
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

  // Show that a thing was moved away from its path, or is on it again.
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
    const tell = (x) => {
      const words = `${PlayPanel.number(x)}${unit && unit !== "–" ? ` ${unit}` : ""}`;
      shown.textContent = input.ariaValueText = words;
      input.style.setProperty("--share", `${100 * clamp(place(x), 0, 1)}%`);
    };
    const show = (x) => {
      if (input.matches(":active")) return;
      input.value = place(x);
      tell(x);
    };
    on(input, "input", () => {
      // Three significant digits are enough to set a gain, and its ends are exact.
      const next = clamp(Number(valueAt(Number(input.value)).toPrecision(3)), low, high);
      tell(next);
      this.set(id, next);
    });
    this.setters.set(id, show);
    show(value);
    const name = make("label", {htmlFor: input.id}, PlayPanel.named(control), shown);
    return make("div", {className: "play-row slider"}, name, input);
  }

  switch(control) {
    const {id, value} = control;
    const input = make("input", {type: "checkbox", role: "switch", checked: value});
    on(input, "change", () => this.set(id, input.checked));
    this.setters.set(id, (checked) => { input.checked = checked; });
    return make("div", {className: "play-row switch"},
                make("label", {}, PlayPanel.named(control), input));
  }

  static named({label, note}) { return make("span", {}, label, make("small", {}, note ?? "")); }

  // Ask for a value; what the program said before it heard of it is not shown.
  set(id, value) {
    const key = `set ${id}`;
    this.play.touch(key);
    this.play.sendLater(key, {do: "set", id, value});
  }

  setValues(values) {
    for (const [id, value] of Object.entries(values)) {
      if (this.play.isFresh(`set ${id}`)) this.setters.get(id)?.(value);
    }
  }

  static number(value) {
    const text = value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5)
      ? value.toExponential(1) : String(Number(value.toPrecision(3)));
    return Plot.minus(text);
  }
}

// Over the scene: the name of what is selected or dragged, and the spring by which a link is
// pulled. It also holds one invisible button per target and obstacle, at its place, so that the
// Tab key and screen readers find them.
class PlayOverlay {
  // From 0 to 1, with nine turns.
  static COIL = `M0 0H.1q.0222 -2 .0444 0${"t.0444 0".repeat(17)}H1`;

  constructor() {
    this.box = part(".play-overlay");
    [this.handles, this.spring, this.force] =
      [".play-handles", ".spring", ".force"].map((name) => part(name, this.box));
    for (const line of this.spring.querySelectorAll("path")) line.setAttribute("d", PlayOverlay.COIL);
    this.buttons = this.labels = new Map();
  }

  // One button per gizmo; select(key) is called when one gets the focus.
  setThings(gizmos, select) {
    this.buttons = new Map(gizmos.map(({key, noun, target}, k) => {
      const number = k < 9 ? `, key ${k + 1}` : "";
      const ariaLabel = `${noun} ${target.name}${number}: arrow keys and page up, page down move it`;
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
    const [coil, ...ends] = this.spring.children, [dx, dy] = [to.x - from.x, to.y - from.y];
    const length = Math.hypot(dx, dy), angle = Math.atan2(dy, dx) * 180 / Math.PI;
    // It becomes thinner as it is stretched.
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
