// What the plots of a run (plots.js) and those of `hsp play` (live_plots.js) share:
// their measures, the ticks of axes, numbers, and the box with a title and a legend.
//
//   const box = new PlotBox("h3", {title, note, series: [{name, color, dashed, band}]}, picture);
//   box.onisolate = () => draw();      // box.alone: the place of the only series shown, or null
//   box.outputs[k].textContent = ...   // beside the name of a series
//   box.moment.textContent = ...       // right of the title
"use strict";

const PlotAxes = {
  HEIGHT: 118,  // px
  MARGIN: {left: 60, right: 12, top: 6, bottom: 20},  // px
  FONT: '10.5px system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif',

  // About `count` round numbers from low to high.
  steps(low, high, count) {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw * 0.999);
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    const ticks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
      ticks.push(k * step);
    }
    const label = (tick) => Math.abs(tick) < step / 2 ? "0"
      : digits > 4 ? tick.toExponential(1) : tick.toFixed(digits);
    return {ticks, label: (tick) => label(tick).replace(/-/g, "−")};
  },

  // Powers of ten between two exponents, at most five.
  decades(low, high) {
    const every = Math.max(1, Math.ceil((high - low) / 4.5));
    const ticks = [];
    for (let k = every * Math.ceil(low / every); k <= high; k += every) ticks.push(k);
    const raised = (text) => [...text].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("");
    return {ticks, label: (tick) => tick === 0 ? "1" : `10${raised(String(tick))}`};
  },

  // The ticks of the time axis, without those that its unit would cover.
  clock(start, end, width) {
    const {ticks, label} = PlotAxes.steps(start, end, Math.max(2, Math.min(6, width / 45)));
    const free = end - 38 / width * (end - start);
    return {ticks: ticks.filter((tick) => tick <= free), label};
  },

  // A number with few characters, always of about the same width.
  number(value) {
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    const text = size !== 0 && (size < 1e-3 || size >= 1e5)
      ? value.toExponential(1) : value.toFixed(size < 10 ? 3 : size < 1000 ? 1 : 0);
    return text.replace(/-/g, "−");
  },
};

class PlotBox {
  constructor(heading, {title, note, series}, picture) {
    this.alone = null;
    this.onisolate = () => {};
    this.box = document.createElement("section");
    this.box.className = "plot";
    const head = document.createElement(heading);
    const small = document.createElement("small");
    small.textContent = note ?? "";
    this.moment = document.createElement("time");
    head.append(title, " ", small, this.moment);
    const legend = document.createElement("ul");
    this.outputs = series.map(({name, color, dashed, band}, k) => {
      const entry = document.createElement("li");
      const button = document.createElement("button");
      button.type = "button";
      button.title = "Show it alone, or all";
      button.setAttribute("aria-pressed", "false");
      button.style.setProperty("--color", color);
      button.classList.toggle("dashed", Boolean(dashed));
      button.classList.toggle("band", Boolean(band));
      const value = document.createElement("output");
      value.setAttribute("aria-live", "off");
      button.append(Object.assign(document.createElement("span"), {textContent: name}), value);
      button.onclick = (event) => {
        this.isolate(this.alone === k ? null : k);
        if (event.detail) button.blur();  // a click of the mouse: space remains the player's
      };
      entry.append(button);
      legend.append(entry);
      return value;
    });
    // Space and enter press a button that has the focus; the player must not take them.
    legend.onkeydown = (event) => {
      if (event.key === " " || event.key === "Enter") event.stopPropagation();
    };
    this.box.append(head, picture, legend);
  }

  isolate(place) {
    this.alone = place;
    this.outputs.forEach((output, k) => {
      const button = output.parentElement;
      button.setAttribute("aria-pressed", place === k);
      button.classList.toggle("off", !this.shows(k));
    });
    this.onisolate();
  }

  shows(place) { return this.alone === null || this.alone === place; }
}
