// What is drawn over the scene in pixels: the name of what is selected or dragged, a circle
// around it, and the spring by which a link is pulled.
//
// It also holds one invisible button per target and obstacle, at its place, so that the
// Tab key and screen readers find them.
"use strict";

class PlayOverlay {
  constructor(parent) {
    this.box = document.createElement("div");
    this.box.className = "play-overlay";
    this.box.innerHTML = `<div class="play-handles"></div>
      <svg aria-hidden="true"><circle class="focus"/>
        <g class="spring"><path class="halo"/><path class="coil"/><circle class="from"/>
        <circle class="to"/></g></svg>
      <div class="play-label name" aria-hidden="true"></div>
      <div class="play-label force" role="status"></div>`;
    const part = (selector) => this.box.querySelector(selector);
    [this.handles, this.circle, this.spring, this.name, this.force] =
      [".play-handles", ".focus", ".spring", ".name", ".force"].map(part);
    parent.append(this.box);
    this.buttons = new Map();
  }

  // One button per thing: {key, label}; select(key) is called when one gets the focus.
  setThings(things, select) {
    this.handles.replaceChildren();
    this.buttons.clear();
    things.forEach(({key, label}, k) => {
      const button = document.createElement("button");
      button.type = "button";
      const number = k < 9 ? `, key ${k + 1}` : "";
      button.setAttribute("aria-label",
                          `${label}${number}: arrow keys and page up, page down move it`);
      button.addEventListener("focus", () => select(key));
      this.handles.append(button);
      this.buttons.set(key, button);
    });
  }

  placeButton(key, {x, y, ahead}) {
    const {style} = this.buttons.get(key) ?? {};
    if (style && ahead) style.transform = `translate(${x.toFixed(0)}px, ${y.toFixed(0)}px)`;
  }

  // A circle of a radius [px] around a thing, and its name above it; null hides both.
  showThing(at, radius, text, strong) {
    const visible = Boolean(at?.ahead);
    this.circle.style.display = visible ? "" : "none";
    this.name.hidden = !visible;
    if (!visible) return;
    PlayOverlay.set(this.circle, {cx: at.x, cy: at.y, r: radius});
    this.circle.classList.toggle("strong", strong);
    this.name.textContent = text;
    PlayOverlay.place(this.name, at.x, at.y - radius - 12);
  }

  // A spring between two pixels with its force [N]; null hides it.
  showSpring(from, to, newtons) {
    const visible = Boolean(from?.ahead && to?.ahead);
    this.spring.style.display = visible ? "" : "none";
    this.force.hidden = !visible || newtons === null;
    if (!visible) return;
    const path = PlayOverlay.coil(from, to);
    for (const line of this.spring.querySelectorAll("path")) line.setAttribute("d", path);
    PlayOverlay.set(this.spring.querySelector(".from"), {cx: from.x, cy: from.y, r: 4});
    PlayOverlay.set(this.spring.querySelector(".to"), {cx: to.x, cy: to.y, r: 7});
    if (newtons === null) return;
    this.force.textContent = `${newtons < 10 ? newtons.toFixed(1) : newtons.toFixed(0)} N`;
    PlayOverlay.place(this.force, to.x, to.y - 18);
  }

  // The path of a coil spring: it becomes thinner as it is stretched.
  static coil(from, to) {
    const [dx, dy] = [to.x - from.x, to.y - from.y];
    const length = Math.hypot(dx, dy);
    const lead = Math.min(14, 0.2 * length), turns = 9, parts = turns * 12;
    const height = Math.max(2, Math.min(7, 900 / (length + 60), 0.2 * length));
    const [ux, uy] = length ? [dx / length, dy / length] : [1, 0];
    const point = (along, across) =>
      `${(from.x + along * ux - across * uy).toFixed(1)} `
      + `${(from.y + along * uy + across * ux).toFixed(1)}`;
    const points = [point(0, 0)];
    for (let k = 0; k <= parts; k++) {
      const along = lead + (length - 2 * lead) * k / parts;
      points.push(point(along, height * Math.sin(2 * Math.PI * turns * k / parts)));
    }
    return `M${[...points, point(length, 0)].join("L")}`;
  }

  static set(element, attributes) {
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  }

  // Centre a label above a pixel, inside the window.
  static place(label, x, y) {
    const half = label.offsetWidth / 2 + 6;
    const inside = Math.min(Math.max(x, half), innerWidth - half);
    const below = Math.max(y, label.offsetHeight + 6);
    label.style.transform = `translate(${inside.toFixed(1)}px, ${below.toFixed(1)}px) `
      + "translate(-50%, -100%)";
  }
}
