// The bands on the time line: when a limit, a singularity or an obstacle acted on the law.
//
//   new Bands(player, controls);    // a Player and its Controls
//
// One row per kind, below the rail. A band under the pointer, or with the focus, is named with
// its times; a click goes to its start. While the player's time is inside a band, its caption
// stands above the bar.
"use strict";

class Bands {
  constructor(player, {bar, parent}) {
    this.player = player;
    this.bar = bar;
    this.rows = bar.querySelector(".bands");
    this.label = document.createElement("div");
    this.label.className = "band-name";
    this.label.hidden = true;
    bar.append(this.label);
    this.moments = document.createElement("div");
    this.moments.className = "moments";
    this.moments.setAttribute("role", "status");
    parent.append(this.moments);
    for (const kind of ["pointerover", "focusin"]) {
      this.rows.addEventListener(kind, ({target}) => this.showName(target));
    }
    for (const kind of ["pointerout", "focusout"]) {
      this.rows.addEventListener(kind, () => this.showName(document.activeElement));
    }
    this.rows.addEventListener("click", ({target, pointerType}) => {
      if (!target.dataset.start) return;
      player.seek(Number(target.dataset.start));
      if (pointerType === "mouse") target.blur();  // a finger's tap keeps the name in sight
    });
    player.addEventListener("state", () => this.draw());
    player.addEventListener("time", () => this.showTime());
    this.draw();
  }

  // Draw the bands anew if there are others; else the one with the focus would lose it.
  draw() {
    const {start, horizon, bands} = this.player;
    const drawn = JSON.stringify([start, horizon, [...bands.values()]]);
    if (drawn !== this.drawn) {
      this.drawn = drawn;
      const share = (seconds) => `${100 * seconds / (horizon - start || 1)}%`;
      // The rows of a comparison are many: they share the space below the rail.
      this.rows.style.setProperty("--pitch", `${Math.min(4, 16 / bands.size)}px`);
      this.rows.replaceChildren(...[...bands.values()].map(({name, color, spans}) => {
        const row = document.createElement("div");
        row.style.setProperty("--color", color);
        row.append(...spans.map(([from, to]) => {
          const band = document.createElement("button");
          band.type = "button";
          band.dataset.start = from;
          band.setAttribute("aria-label", Bands.words(name, from, to));
          band.style.left = share(from - start);
          band.style.width = share(to - from);
          return band;
        }));
        return row;
      }));
      this.showName(null);
    }
    this.showTime();
  }

  // Name a band above it; anything else hides the name.
  showName(band) {
    const named = Boolean(band?.dataset?.start) && this.rows.contains(band);
    this.label.hidden = !named;
    if (!named) return;
    this.label.textContent = band.getAttribute("aria-label");
    const bar = this.bar.getBoundingClientRect(), box = band.getBoundingClientRect();
    const half = this.label.offsetWidth / 2, middle = (box.left + box.right) / 2 - bar.left;
    const place = Math.max(half + 4, Math.min(middle, bar.width - half - 4));
    this.label.style.left = `${place}px`;
  }

  showTime() {
    const {time, loaded, bands} = this.player;
    const inside = loaded ? [...bands.values()].filter(({spans}) =>
      spans.some(([from, to]) => from <= time && time <= to)) : [];
    const told = inside.map(({caption}) => caption).join("\n");
    if (told === this.told) return;
    this.told = told;
    this.moments.replaceChildren(...inside.map(({caption, color}) => {
      const moment = document.createElement("span");
      moment.textContent = caption;
      moment.style.setProperty("--color", color);
      return moment;
    }));
  }

  static words(name, from, to) { return `${name} ${from.toFixed(2)}–${to.toFixed(2)} s`; }
}
