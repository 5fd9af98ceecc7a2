// The legend, whose rows are switches: each shows and hides the nodes of what it names.
//
// A row says what is in the scene: it is pressed while its nodes are visible. What the user
// chooses is kept as long as the page is open, also when the nodes are drawn again. In small
// windows the rows are behind a button, so that they do not cover the robot.
"use strict";

class Legend {
  static SMALL = "(max-width: 760px), (max-height: 480px), "
    + "(max-width: 860px) and (max-aspect-ratio: 6/5)";

  // Add it to the element that has the title, too.
  constructor(viewer, caption) {
    Object.assign(this, {viewer, caption, rows: []});
    this.choices = new Map();  // path -> whether the user wants to see it
    this.toggle = makeButton(
      {className: "layers-toggle", hidden: true,  // before there are layers
       title: "Show or hide the legend, whose rows are switches", "aria-controls": "layers"},
      () => this.setOpen(!this.open),
      makeIcon("M12 3 2 8.5 12 14l10-5.5zM4.2 12.2 2 13.4l10 5.5 10-5.5-2.2-1.2L12 16.5zM4.2 16.7 2 "
        + "17.9 12 23.4l10-5.5-2.2-1.2L12 21z"), "Layers");
    this.list = make("ul", {id: "layers", ariaLabel: "Layers"});
    caption.append(this.toggle, this.list);
    caption.addEventListener("keydown", ({key}) => {
      if (key === "Escape" && this.small.matches) this.setOpen(false);
    });
    this.small = matchMedia(Legend.SMALL);
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
    this.toggle.ariaExpanded = open;
  }

  // End the rows where the picture ends: below it may be a bar, a sheet or plots.
  measure() {
    const {bottom} = this.viewer.dom_element.getBoundingClientRect();
    const room = bottom - this.list.getBoundingClientRect().top - 8;
    this.list.style.setProperty("--room", `${Math.max(room, 120)}px`);
  }

  // Show the rows of a caption (viewer/commands.py); repeated ones are kept, and with them the focus.
  show(entries) {
    const told = JSON.stringify(entries);
    if (told !== this.told) {
      this.told = told;
      this.rows = entries.map((entry) => this.row(entry));
      this.toggle.hidden = !entries.length;
      this.list.replaceChildren(...this.rows.map(({button}) => button.parentElement));
    }
    this.apply();
  }

  row(entry) {
    const button = makeButton({style: `--color: ${entry.color}`}, () => {
      const shown = button.ariaPressed !== "true";
      for (const path of entry.paths) this.choices.set(path, shown);
      this.apply();
      this.viewer.set_dirty();
    }, entry.name);
    make("li", {className: entry.plain ? "plain" : ""}, button);
    return {entry, button};
  }

  // Bring the user's choices into the scene, and the scene's state into the rows.
  apply() {
    for (const [path, shown] of this.choices) {
      const known = findNode(this.viewer, path);
      if (known) known.object.visible = shown;
    }
    for (const {entry, button} of this.rows) {
      const nodes = entry.paths.map((path) => findNode(this.viewer, path)).filter(Boolean);
      const on = nodes.length ? nodes.some(({object}) => object.visible)
        : this.choices.get(entry.paths[0]) ?? entry.shown;
      if (button.ariaPressed !== String(on)) button.ariaPressed = on;
    }
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
