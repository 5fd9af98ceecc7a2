// The legend, whose rows are switches: each shows and hides the nodes that it names. What the user
// chooses is kept as long as the page is open, also when the nodes are drawn again. In small windows
// the rows are behind a button.

class Legend {
  static SMALL = "(max-width: 760px), (max-height: 480px), "
    + "(max-width: 860px) and (max-aspect-ratio: 6/5)";

  constructor(viewer) {
    Object.assign(this, {viewer, rows: [], keepClosed: false, small: matchMedia(Legend.SMALL)});
    this.choices = new Map();  // path -> whether the user wants to see it
    this.caption = part("#caption");
    this.list = part("#layers");
    this.views = make("li", {className: "plain"}, part(".views"));  // its first row; see Views
    this.toggle = onPress(part(".layers-toggle"), () => this.setOpen(!this.open));
    on(this.caption, "keydown", ({key}) => {
      if (key === "Escape" && this.small.matches) this.setOpen(false);
    });
    on(this.small, "change", () => this.fit());
    onKey(({key, repeat}) => {
      const found = !repeat && this.rows.find(([entry]) => entry.key === key);
      return found && (() => found[1].click());
    });
    this.fit();
  }

  fit() {
    this.caption.classList.toggle("small", this.small.matches);
    this.setOpen(!this.small.matches && !this.keepClosed);
  }

  setOpen(open) {
    this.open = this.toggle.ariaExpanded = open;
    this.list.hidden = !open;
  }

  // Show the rows of a caption (viewer/commands.py); repeated ones are kept, and with them the focus.
  show(entries) {
    const shownText = JSON.stringify(entries);
    if (shownText === this.shownText) return;
    this.shownText = shownText;
    this.rows = entries.map((entry) => [entry, this.row(entry)]);
    this.toggle.hidden = !entries.length;
    const own = this.rows.filter(([{short}]) => !short);
    this.list.replaceChildren(this.views, ...own.map(([{plain}, row]) =>
      make("li", {className: plain ? "plain" : ""}, row)));
    part(".beside", this.views).replaceChildren(
      ...this.rows.filter(([{short}]) => short).map(([, row]) => row));
  }

  row({name, color, paths, short, key}) {
    const title = key ? `${name} (${key})` : "";
    return makeButton({style: `--color: ${color}`, title}, ({currentTarget: {ariaPressed}}) => {
      for (const path of paths) this.choices.set(path, ariaPressed !== "true");
      this.apply();
      this.viewer.set_dirty();
    }, short || name);
  }

  // Bring the user's choices into the scene, and the scene's state into the rows.
  apply() {
    const objectOf = (path) => findNode(this.viewer, path)?.object;
    for (const [path, visible] of this.choices) Object.assign(objectOf(path) ?? {}, {visible});
    for (const [{paths, shown}, row] of this.rows) {
      const objects = paths.map(objectOf).filter(Boolean);
      const pressed = objects.length ? objects.some(({visible}) => visible)
        : this.choices.get(paths[0]) ?? shown;
      if (row.ariaPressed !== String(pressed)) row.ariaPressed = pressed;
    }
  }

  // How far the legend reaches into the picture from the left [px].
  get reach() {
    if (!this.open || this.small.matches || !this.rows.length) return 0;
    return this.list.getBoundingClientRect().right
      - this.viewer.dom_element.getBoundingClientRect().left;
  }

  // The height that the caption covers at the top of the picture [px].
  get covered() {
    const heading = part("h1", this.caption);
    return this.small.matches ? heading.offsetTop + heading.offsetHeight : 0;
  }
}
