// The plots beside the scene: curves over time, and a cursor at the player's time.
//
//   new Plots(player, side, {start, end, damped, panels, colors});
//
// with the data of viewer/export/panels.py. A click or drag in a plot sets the player's time.
"use strict";

const SVG = "http://www.w3.org/2000/svg";

function svg(name, attributes, parent) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent?.append(element);
  return element;
}

class Plots {
  constructor(player, parent, {start, end, damped, panels, colors}) {
    Object.assign(this, {player, start, end: end > start ? end : start + 1, damped, colors});
    this.plots = panels.map((panel) => new Plot(this, parent, panel));
    player.addEventListener("time", () => this.showTime());
    new ResizeObserver(() => this.draw()).observe(parent);
    this.draw();
  }

  draw() {
    for (const plot of this.plots) plot.draw();
    this.showTime();
  }

  showTime() {
    for (const plot of this.plots) plot.showTime(this.player.time);
  }
}

class Plot {
  static HEIGHT = 118;
  static MARGIN = {left: 50, right: 12, top: 6, bottom: 20};

  constructor(plots, parent, panel) {
    Object.assign(this, {plots, panel, name: `plot-${parent.childElementCount}`});
    const box = document.createElement("section");
    const heading = document.createElement("h2");
    heading.textContent = panel.title;
    const unit = document.createElement("small");
    unit.textContent = panel.unit === "–" ? "" : panel.unit;
    heading.append(" ", unit);
    const legend = document.createElement("ul");
    this.entries = panel.series.map(({name, color, dashed}) => {
      const entry = document.createElement("li");
      entry.style.setProperty("--color", color);
      if (dashed) entry.classList.add("dashed");
      const value = document.createElement("output");
      entry.append(name, value);
      legend.append(entry);
      return value;
    });
    this.picture = svg("svg", {role: "img", "aria-label": panel.title});
    box.append(heading, this.picture, legend);
    parent.append(box);
    this.picture.addEventListener("pointerdown", (event) => this.drag(event));
  }

  // The coordinates of a time and a value in the plot.
  x(time) {
    const {start, end} = this.plots;
    return Plot.MARGIN.left + (time - start) / (end - start) * this.width;
  }

  y(value) {
    const {low, high} = this.panel;
    return Plot.MARGIN.top + (high - value) / (high - low) * this.height;
  }

  draw() {
    const {panel, picture, plots} = this;
    const {left, right, top, bottom} = Plot.MARGIN;
    const {ink, muted, grid, contact, warning} = plots.colors;
    const full = picture.clientWidth;
    if (!full) return;
    this.width = full - left - right;
    this.height = Plot.HEIGHT - top - bottom;
    picture.replaceChildren();
    picture.setAttribute("viewBox", `0 0 ${full} ${Plot.HEIGHT}`);
    for (const [from, to] of plots.damped) {
      const x = this.x(from);
      svg("rect", {x, y: top, width: Math.max(this.x(to) - x, 1), height: this.height,
                   fill: warning, opacity: 0.15}, picture)
        .append(svg("title", {}));
      picture.lastChild.firstChild.textContent = "damped near a singularity";
    }
    const {ticks, label} = panel.logarithmic
      ? decades(panel.low, panel.high) : steps(panel.low, panel.high, 4);
    for (const tick of ticks) {
      const y = this.y(tick);
      svg("line", {x1: left, x2: left + this.width, y1: y, y2: y, stroke: grid}, picture);
      svg("text", {x: left - 7, y: y + 3.5, "text-anchor": "end"}, picture)
        .textContent = label(tick);
    }
    const clock = steps(plots.start, plots.end, Math.max(2, Math.min(6, this.width / 70)));
    for (const tick of clock.ticks) {
      svg("text", {x: this.x(tick), y: Plot.HEIGHT - 6, "text-anchor": "middle"}, picture)
        .textContent = clock.label(tick);
    }
    if (panel.zero) {
      const y = this.y(0);
      svg("line", {x1: left, x2: left + this.width, y1: y, y2: y, stroke: contact}, picture);
    }
    svg("line", {x1: left, x2: left + this.width, y1: top + this.height,
                 y2: top + this.height, stroke: muted}, picture);
    const inside = svg("clipPath", {id: this.name}, picture);
    svg("rect", {x: left, y: top - 2, width: this.width, height: this.height + 2}, inside);
    for (const {times, values, color, dashed} of panel.series) {
      const points = Array.from(times, (time, i) =>
        `${this.x(time).toFixed(1)},${this.y(values[i]).toFixed(1)}`);
      svg("polyline", {points: points.join(" "), fill: "none", stroke: color,
                       "stroke-width": 1.6, "stroke-linejoin": "round",
                       "stroke-dasharray": dashed ? "5 3" : "none",
                       "clip-path": `url(#${this.name})`}, picture);
    }
    this.cursor = svg("g", {class: "cursor"}, picture);
    svg("line", {y1: top, y2: top + this.height, stroke: ink, "stroke-width": 1.2}, this.cursor);
    this.dots = panel.series.map(({color}) => svg(
      "circle", {r: 3.2, fill: color, stroke: "#FFFFFF", "stroke-width": 1.2}, this.cursor));
  }

  showTime(time) {
    if (!this.cursor) return;
    const {panel} = this;
    this.cursor.setAttribute("transform", `translate(${this.x(time).toFixed(2)} 0)`);
    this.cursor.dataset.time = time;
    panel.series.forEach((series, i) => {
      const value = valueAt(series, time);
      this.dots[i].setAttribute("cy", this.y(value));
      this.dots[i].style.display = value < panel.low || value > panel.high ? "none" : "";
      this.entries[i].textContent = shortNumber(panel.logarithmic ? 10 ** value : value);
    });
  }

  // While the plot is dragged, pause the player at the time under the pointer.
  drag(event) {
    if (event.button) return;
    const {player, start, end} = this.plots;
    const resume = player.playing;
    const follow = ({clientX}) => {
      const x = clientX - this.picture.getBoundingClientRect().left - Plot.MARGIN.left;
      player.seek(start + x / this.width * (end - start));
    };
    player.pause();
    follow(event);
    this.picture.setPointerCapture(event.pointerId);
    this.picture.addEventListener("pointermove", follow);
    const release = () => {
      this.picture.removeEventListener("pointermove", follow);
      if (resume) player.play();
    };
    for (const end of ["pointerup", "pointercancel"]) {
      this.picture.addEventListener(end, release, {once: true});
    }
  }
}

// A curve's value at a time, interpolated linearly between two of its points.
function valueAt({times, values}, time) {
  let low = 0, high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  const fraction = high > low ? (time - times[low]) / (times[high] - times[low]) : 0;
  return values[low] + Math.min(Math.max(fraction, 0), 1) * (values[high] - values[low]);
}

// About `count` round numbers from low to high.
function steps(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const step = power * [1, 2, 5, 10].find((factor) => factor * power >= raw * 0.999);
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) {
    ticks.push(k * step);
  }
  return {ticks, label: (tick) => (Math.abs(tick) < step / 2 ? 0 : tick).toFixed(digits)
    .replace("-", "−")};
}

// Powers of ten between two exponents, at most five.
function decades(low, high) {
  const every = Math.max(1, Math.ceil((high - low) / 4.5));
  const ticks = [];
  for (let k = every * Math.ceil(low / every); k <= high; k += every) ticks.push(k);
  const raised = (text) => [...text].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("");
  return {ticks, label: (tick) => tick === 0 ? "1" : `10${raised(String(tick))}`};
}

// A number with few characters, always of about the same width.
function shortNumber(value) {
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-3 || size >= 1e5)
    ? value.toExponential(1) : value.toFixed(size < 10 ? 3 : size < 1000 ? 1 : 0);
  return text.replace(/-/g, "−");
}
