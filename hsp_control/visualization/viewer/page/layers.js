// The legend, whose rows are switches: each shows and hides the nodes of what it names.
//
//   const layers = new Layers(viewer, caption);   // the element with title and legend
//   layers.show(entries);                         // of a caption: see viewer/appearance.py
//   layers.apply();                               // after the scene has changed
//
// A row says what is in the scene: it is pressed while its nodes are visible. What the user
// chooses is kept as long as the page is open, also when the nodes are drawn again. In small
// windows the rows are behind a button, so that they do not cover the robot.
"use strict";

class Layers {
  static SMALL = "(max-width: 760px), (max-height: 480px), "
    + "(max-width: 860px) and (max-aspect-ratio: 6/5)";

  constructor(viewer, caption) {
    this.viewer = viewer;
    this.caption = caption;
    this.choices = new Map();  // path -> whether the user wants to see it
    this.rows = [];
    this.toggle = document.createElement("button");
    this.toggle.className = "layers-toggle";
    this.toggle.hidden = true;  // before there are layers
    this.toggle.type = "button";
    this.toggle.title = "Show or hide the legend, whose rows are switches";
    this.toggle.setAttribute("aria-controls", "layers");
    this.toggle.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="M12 3 2 8.5 12
      14l10-5.5zM4.2 12.2 2 13.4l10 5.5 10-5.5-2.2-1.2L12 16.5zM4.2 16.7 2 17.9 12 23.4l10-5.5
      -2.2-1.2L12 21z"/></svg>Layers`;
    this.list = document.createElement("ul");
    this.list.id = "layers";
    this.list.setAttribute("aria-label", "Layers");
    caption.append(this.toggle, this.list);
    this.toggle.onclick = (event) => {
      this.setOpen(!this.open);
      if (event.detail) this.toggle.blur();  // return the keyboard to the player
    };
    // Space and enter press a button that has the focus; the player must not take them.
    caption.addEventListener("keydown", (event) => {
      if (event.key === " " || event.key === "Enter") event.stopPropagation();
      if (event.key === "Escape" && this.small.matches) this.setOpen(false);
    });
    this.small = matchMedia(Layers.SMALL);
    this.small.addEventListener("change", () => this.fit());
    this.fit();
  }

  // Collapse the rows in a small window, show them in a large one.
  fit() {
    this.caption.classList.toggle("small", this.small.matches);
    this.setOpen(!this.small.matches);
  }

  setOpen(open) {
    this.open = open;
    this.list.hidden = !open;
    this.measure();
    this.toggle.setAttribute("aria-expanded", open);
  }

  // End the rows where the picture ends: below it may be a bar, a sheet or plots.
  measure() {
    const {bottom} = this.viewer.dom_element.getBoundingClientRect();
    const room = bottom - this.list.getBoundingClientRect().top - 8;
    this.list.style.setProperty("--room", `${Math.max(room, 120)}px`);
  }

  // Show a legend; a repeated one keeps its rows, and with them the focus.
  show(entries) {
    const told = JSON.stringify(entries);
    if (told !== this.told) {
      this.told = told;
      this.rows = entries.map((entry) => this.row(entry));
      this.toggle.hidden = !entries.length;
      this.list.replaceChildren(...this.rows.map(({item}) => item));
    }
    this.apply();
  }

  row(entry) {
    const item = document.createElement("li");
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = entry.name;
    button.style.setProperty("--color", entry.color);
    button.onclick = (event) => {
      this.set(entry.paths, button.getAttribute("aria-pressed") !== "true");
      if (event.detail) button.blur();  // a click of the mouse: space remains the player's
    };
    item.classList.toggle("plain", entry.plain);
    item.append(button);
    return {entry, item, button};
  }

  // Show or hide nodes, as the user wishes.
  set(paths, shown) {
    for (const path of paths) this.choices.set(path, shown);
    this.apply();
    this.viewer.set_dirty();
  }

  // Bring the user's choices into the scene, and the scene's state into the rows.
  apply() {
    for (const [path, shown] of this.choices) {
      const known = this.find(path);
      if (known) known.visible = shown;
    }
    for (const {entry, button} of this.rows) {
      const nodes = entry.paths.map((path) => this.find(path)).filter(Boolean);
      const on = nodes.length ? nodes.some(({visible}) => visible)
        : this.choices.get(entry.paths[0]) ?? entry.shown;
      const state = String(on);
      if (button.getAttribute("aria-pressed") !== state) button.setAttribute("aria-pressed", state);
    }
  }

  // The object of a node; none is created.
  find(path) {
    let node = this.viewer.scene_tree;
    for (const name of path.split("/")) {
      if (name && node) node = node.children[name];
    }
    return node?.object;
  }

  // How far the legend reaches into the picture from the left [px].
  get reach() {
    if (!this.open || this.small.matches || !this.rows.length) return 0;
    return this.list.getBoundingClientRect().right
      - this.viewer.dom_element.getBoundingClientRect().left;
  }

  // The height of what the caption covers at the top of the picture [px].
  get covered() {
    const heading = this.caption.querySelector("h1");
    return this.small.matches ? heading.offsetTop + heading.offsetHeight : 0;
  }
}
