// The panel beside the scene: the targets, the controls in their groups, the live plots.
//
// A value is the program's: a change is sent, and the value that the program then reports
// is shown, so a refused one goes back. While a slider is held, and a moment after each
// change, what the program said before does not count.
"use strict";

class PlayPanel {
  static OBSTACLE = "#D55E00";  // appearance.OBSTACLE
  static NARROW = "(max-width: 620px), (max-width: 860px) and (max-aspect-ratio: 6/5)";

  constructor(play, parent) {
    this.play = play;
    this.open = false;
    this.narrow = matchMedia(PlayPanel.NARROW);
    this.box = document.createElement("aside");
    this.box.className = "play-panel";
    this.box.setAttribute("aria-label", "Controls and plots");
    this.box.innerHTML = `
      <header><h2></h2><button type="button" aria-label="Close the panel" title="Close">
        <svg viewBox="0 0 24 24" aria-hidden="true"><path d="M6.4 5 12 10.6 17.6 5 19 6.4 13.4
          12l5.6 5.6-1.4 1.4-5.6-5.6L6.4 19 5 17.6l5.6-5.6L5 6.4z"/></svg></button></header>
      <div class="play-content"><fieldset class="play-controls"></fieldset>
        <div class="play-plots"></div>
        <p class="play-help">Drag a handle, an obstacle or a link; drag beside them to turn
          the view. <kbd>Tab</kbd> selects, <kbd>← → ↑ ↓</kbd> <kbd>Page ↑ ↓</kbd> move by
          1 cm, with <kbd>Shift</kbd> by 1 mm. <span class="simulated"><kbd>Space</kbd>
          pauses, <kbd>.</kbd> steps, <kbd>R</kbd> resets, <kbd>S</kbd> saves.</span>
          <kbd>P</kbd> presents.</p></div>`;
    this.title = this.box.querySelector("h2");
    this.controls = this.box.querySelector(".play-controls");
    this.plots = this.box.querySelector(".play-plots");
    this.box.querySelector("header button").onclick = () => this.setOpen(false);
    // On a phone there is room for the sheet or the legend.
    layers.toggle.addEventListener("click", () => {
      if (layers.open && this.narrow.matches) this.setOpen(false);
    });
    parent.append(this.box);
    this.setters = new Map();
    this.asked = new Map();  // id -> when the page has asked for a value [ms]
  }

  setOpen(open) {
    this.open = open;
    if (open && this.narrow.matches) layers.setOpen(false);
    this.box.inert = !open;
    document.body.classList.toggle("with-panel", open);
    this.play.bar.showPanel(open);
    this.play.plots?.schedule();
    this.play.fit();
  }

  build({title, targets, obstacles, controls}) {
    this.title.textContent = title || "Play";
    this.setters.clear();
    this.asked.clear();
    const groups = new Map();
    for (const control of controls) {
      const group = control.group || "Settings";
      if (!groups.has(group)) groups.set(group, []);
      groups.get(group).push(control);
    }
    this.things = new Map();
    const things = {
      Targets: targets.map((one) => this.thing(PlayHand.targetKey(one.name), one)),
      Obstacles: obstacles.map((one) =>
        this.thing(PlayHand.obstacleKey(one.name), {...one, color: PlayPanel.OBSTACLE})),
    };
    const sections = Object.entries(things).filter(([, rows]) => rows.length)
      .map(([name, rows]) => PlayPanel.section(name, rows));
    for (const [name, own] of groups) {
      sections.push(PlayPanel.section(name, own.map((control) => this.control(control))));
    }
    this.controls.replaceChildren(...sections);
  }

  static section(name, rows) {
    const section = document.createElement("section");
    const heading = document.createElement("h3");
    heading.textContent = name;
    section.append(heading, ...rows);
    return section;
  }

  // The name of a target or an obstacle, which selects it, and the way back to its own path.
  thing(key, {name, kind, color}) {
    const row = PlayPanel.row("target", `<button type="button" class="select"><i></i>
      <span></span><small></small></button>
      <button type="button" class="resume">Back to its path</button>`);
    const [select, resume] = row.querySelectorAll("button");
    row.querySelector("span").textContent = name;
    row.querySelector("small").textContent = kind ?? "";
    if (color) row.querySelector("i").style.background = color;
    select.setAttribute("aria-label", `Select ${name}`);
    resume.setAttribute("aria-label", `${name}: back to its own path`);
    select.onclick = () => {
      this.play.overlay.buttons.get(key)?.focus();
      if (this.narrow.matches) this.setOpen(false);
    };
    resume.onclick = () => this.play.resume(key, name);
    this.things.set(key, row);
    return row;
  }

  // Show that a thing was moved away from its path, or is on it again.
  showMoved(key, moved) { this.things.get(key)?.classList.toggle("moved", moved); }

  showSelected(selected) {
    for (const [key, row] of this.things) row.classList.toggle("selected", key === selected);
  }

  control(control) {
    return control.kind === "switch" ? this.switch(control) : this.slider(control);
  }

  slider({id, label, unit, value, low, high, log}) {
    const row = PlayPanel.row("slider", `<label><span></span><output></output></label>
      <input type="range" min="0" max="1" step="0.005">`);
    const [input, shown] = ["input", "output"].map((tag) => row.querySelector(tag));
    row.querySelector("span").textContent = label;
    row.querySelector("label").htmlFor = input.id = `play-${id}`;
    const place = (x) => log ? Math.log(x / low) / Math.log(high / low) : (x - low) / (high - low);
    const value_at = (share) => log ? low * (high / low) ** share : low + share * (high - low);
    const show = (x, move = true) => {
      if (move) input.value = place(x);
      const words = `${PlayPanel.number(x)}${unit && unit !== "–" ? ` ${unit}` : ""}`;
      shown.textContent = words;
      input.setAttribute("aria-valuetext", words);
      input.style.setProperty("--share", `${100 * Math.min(Math.max(place(x), 0), 1)}%`);
    };
    let held = false, reported = null;
    input.oninput = () => {
      const next = PlayPanel.rounded(value_at(Number(input.value)), low, high);
      reported = null;
      show(next, false);
      this.set(id, next);
    };
    const let_go = () => {
      held = false;
      if (reported !== null) show(reported);
    };
    input.onpointerdown = () => { held = true; };
    for (const type of ["pointerup", "pointercancel", "change", "blur"]) {
      input.addEventListener(type, let_go);
    }
    this.setters.set(id, (x) => {
      reported = x;
      if (!held) show(x);
    });
    show(value);
    return row;
  }

  switch({id, label, value}) {
    const row = PlayPanel.row("switch", `<label><span></span>
      <input type="checkbox" role="switch"></label>`);
    const input = row.querySelector("input");
    row.querySelector("span").textContent = label;
    input.checked = value;
    input.onchange = () => this.set(id, input.checked);
    this.setters.set(id, (on) => { input.checked = on; });
    return row;
  }

  // Ask for a value; what the program said before it heard of it is not shown.
  set(id, value) {
    this.asked.set(id, performance.now());
    this.play.set(id, value);
  }

  setValues(values) {
    for (const [id, value] of Object.entries(values)) {
      const fresh = !(performance.now() < this.asked.get(id) + Play.ECHO);
      if (fresh) this.setters.get(id)?.(value);
    }
  }

  setDisabled(disabled) { this.controls.disabled = disabled; }

  static row(kind, content) {
    const row = document.createElement("div");
    row.className = `play-row ${kind}`;
    row.innerHTML = content;
    return row;
  }

  // Three significant digits are enough to set a gain, and its ends are exact.
  static rounded(value, low, high) {
    return Math.min(Math.max(Number(value.toPrecision(3)), low), high);
  }

  static number(value) {
    const text = value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5)
      ? value.toExponential(1) : String(Number(value.toPrecision(3)));
    return text.replace(/-/g, "−");
  }
}
