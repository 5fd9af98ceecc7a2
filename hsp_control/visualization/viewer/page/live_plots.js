// The plots of `hsp play`: the last seconds of every curve, in the style of plots.js:
// both are made of plot_parts.js.
//
//   const plots = new LivePlots(parent, definitions, () => isOpen);
//   plots.add(times, values);     // rows of all series of all plots, in order
//
// Rows are kept in a ring of fixed size. A time that jumps back clears it; a gap in time,
// as after a page has stalled, is drawn as one. Drawn at most 20 times a second, and not
// while the panel is closed, the page is hidden, or a plot is scrolled out of sight.
"use strict";

class LivePlots {
  static SPAN = 10;         // s
  static ROWS = 1 << 14;    // 10 s of 1.6 kHz
  static PERIOD = 50;       // ms

  constructor(parent, definitions, isOpen) {
    Object.assign(this, {isOpen, waiting: false, last: 0});
    let first = 0;
    this.plots = definitions.map((definition) => {
      const plot = new LivePlot(this, definition, first);
      first += definition.series.length;
      return plot;
    });
    this.width = first;
    this.times = new Float64Array(LivePlots.ROWS);
    this.values = new Float32Array(LivePlots.ROWS * first);
    this.clear();
    parent.replaceChildren(...this.plots.map(({box}) => box));
    this.sight = new IntersectionObserver((entries) => {
      for (const {target, isIntersecting} of entries) {
        this.plots.find(({box}) => box === target).inSight = isIntersecting;
      }
      this.schedule();
    });
    this.size = new ResizeObserver(() => this.schedule());
    for (const {box} of this.plots) {
      this.sight.observe(box);
      this.size.observe(box);
    }
    this.onVisible = () => this.schedule();
    document.addEventListener("visibilitychange", this.onVisible);
  }

  dispose() {
    this.sight.disconnect();
    this.size.disconnect();
    document.removeEventListener("visibilitychange", this.onVisible);
  }

  clear() {
    this.begin = this.count = 0;
    this.spacing = null;  // s, usual time between two rows
    this.schedule();
  }

  // The place of a row in the ring; row 0 is the oldest.
  at(row) { return (this.begin + row) % LivePlots.ROWS; }

  time(row) { return this.times[this.at(row)]; }

  get end() { return this.count ? this.time(this.count - 1) : 0; }

  add(times, values) {
    const {width} = this;
    if (values.length !== times.length * width) return;
    for (let k = 0; k < times.length; k++) {
      if (this.count && times[k] <= this.end) {
        if (times[k] > this.end - 1e-9) continue;  // the same row again
        this.clear();
      }
      if (this.count) this._learn(times[k] - this.end);
      if (this.count === LivePlots.ROWS) this.begin = this.at(1);
      else this.count++;
      const at = this.at(this.count - 1);
      this.times[at] = times[k];
      for (let j = 0; j < width; j++) this.values[at * width + j] = values[k * width + j];
    }
    this.schedule();
  }

  _learn(step) {
    if (this.spacing === null || step < this.spacing) this.spacing = step;
    else if (step < 3 * this.spacing) this.spacing += 0.05 * (step - this.spacing);
  }

  // Whether rows are missing between two times.
  isGap(step) { return step > Math.max(0.1, 4 * this.spacing); }

  // The first row at or after a time.
  find(time) {
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < time) low = middle + 1; else high = middle;
    }
    return low;
  }

  get visible() { return this.isOpen() && !document.hidden; }

  schedule() {
    if (this.waiting || !this.plots || !this.visible) return;
    this.waiting = true;
    const rest = Math.max(0, this.last + LivePlots.PERIOD - performance.now());
    setTimeout(() => requestAnimationFrame((now) => {
      this.waiting = false;
      if (!this.visible) return;
      this.last = now;
      this.draw();
    }), rest);
  }

  draw() {
    const style = getComputedStyle(document.body);
    const color = (name) => style.getPropertyValue(`--play-${name}`).trim();
    const colors = {ink: color("ink"), muted: color("muted"), grid: color("grid")};
    for (const plot of this.plots) if (plot.inSight) plot.draw(colors);
  }
}

class LivePlot {
  constructor(plots, definition, first) {
    const {title, series} = definition;
    Object.assign(this, {plots, definition, first, inSight: false, pointer: null, range: null});
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${title}, the last ${LivePlots.SPAN} s`);
    this.frame = new PlotBox("h3", {title, series}, this.canvas);
    this.box = this.frame.box;
    this.frame.onisolate = () => {
      this.range = null;
      plots.schedule();
    };
    const follow = ({clientX}) => {
      this.pointer = clientX - this.canvas.getBoundingClientRect().left;
      plots.schedule();
    };
    this.canvas.onpointermove = this.canvas.onpointerdown = follow;
    this.canvas.onpointerleave = () => {
      this.pointer = null;
      plots.schedule();
    };
  }

  value(row, series) {
    const {plots, first} = this;
    const value = plots.values[plots.at(row) * plots.width + first + series];
    return this.definition.log ? (value > 0 ? Math.log10(value) : NaN) : value;
  }

  draw(colors) {
    const {canvas, plots, definition} = this;
    const {left, right, top, bottom} = PlotAxes.MARGIN;
    const full = canvas.clientWidth, ratio = devicePixelRatio;
    if (!full) return;
    if (canvas.width !== Math.round(full * ratio)) {
      canvas.width = Math.round(full * ratio);
      canvas.height = Math.round(PlotAxes.HEIGHT * ratio);
    }
    const width = full - left - right, height = PlotAxes.HEIGHT - top - bottom;
    const end = Math.max(plots.end, LivePlots.SPAN), start = end - LivePlots.SPAN;
    const from = Math.max(0, plots.find(start) - 1), until = plots.count;
    const [low, high] = this.limits(from, until);
    const x = (time) => left + (time - start) / LivePlots.SPAN * width;
    const y = (value) => top + (high - value) / (high - low) * height;
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, full, PlotAxes.HEIGHT);
    this.drawAxes(pen, colors, {x, y, low, high, start, end, width, height});
    pen.save();
    pen.beginPath();
    pen.rect(left, top - 2, width + 2, height + 3);
    pen.clip();
    pen.lineJoin = "round";
    definition.series.forEach(({color}, k) => {
      if (!this.frame.shows(k)) return;
      pen.strokeStyle = LivePlot.inkOf(color, colors);
      pen.lineWidth = 1.6;
      pen.stroke(this.curve(k, from, until, x, y, width));
    });
    pen.restore();
    this.drawCursor(pen, colors, {x, y, low, high, start, left, width, top, height});
  }

  // A curve; where there are more rows than pixels, the extremes of each pixel.
  curve(series, from, until, x, y, width) {
    const {plots} = this;
    const path = new Path2D();
    const dense = until - from > 3 * width;
    let pen_up = true, column = null, low = 0, high = 0, last_time = NaN;
    const put = (px, value) => {
      if (pen_up) path.moveTo(px, y(value)); else path.lineTo(px, y(value));
      pen_up = false;
    };
    const flush = () => {
      if (column === null) return;
      put(column, low);
      if (high !== low) put(column, high);
      column = null;
    };
    for (let row = from; row < until; row++) {
      const time = plots.time(row), value = this.value(row, series);
      const broken = !Number.isFinite(value) || plots.isGap(time - last_time);
      last_time = time;
      if (broken) {
        flush();
        pen_up = true;
        if (!Number.isFinite(value)) continue;
      }
      if (!dense) {
        put(x(time), value);
        continue;
      }
      const here = Math.round(x(time));
      if (here !== column) {
        flush();
        column = here;
        low = high = value;
      }
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    flush();
    return path;
  }

  // The range of the axis: it grows at once, and shrinks when much of it is unused.
  limits(from, until) {
    const {log, series} = this.definition;
    let low = Infinity, high = -Infinity;
    const every = Math.max(1, Math.floor((until - from) / 2000));
    for (let row = from; row < until; row += every) {
      for (let k = 0; k < series.length; k++) {
        if (!this.frame.shows(k)) continue;
        const value = this.value(row, k);
        if (!Number.isFinite(value)) continue;
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
    if (!(low <= high)) return log ? [-3, 0] : [0, 1];
    if (log) {
      const least = Math.floor(low - 0.05);
      return [least, Math.max(Math.ceil(high + 0.05), least + 1)];
    }
    const least = Math.max(1e-9, 0.02 * Math.max(Math.abs(low), Math.abs(high)));
    const room = Math.max(high - low, least);
    const known = this.range;
    const fits = known && low >= known[0] && high <= known[1]
      && room > 0.55 * (known[1] - known[0]);
    if (!fits) {
      const middle = (low + high) / 2;
      this.range = [middle - 0.62 * room, middle + 0.62 * room];
    }
    return this.range;
  }

  drawAxes(pen, {muted, grid}, {x, y, low, high, start, end, width, height}) {
    const {left, top} = PlotAxes.MARGIN;
    const line = (x1, y1, x2, y2, color) => {
      pen.strokeStyle = color;
      pen.lineWidth = 1;
      pen.beginPath();
      pen.moveTo(x1, y1);
      pen.lineTo(x2, y2);
      pen.stroke();
    };
    pen.font = PlotAxes.FONT;
    pen.fillStyle = muted;
    pen.textAlign = "right";
    const {ticks, label} = this.definition.log
      ? PlotAxes.decades(low, high) : PlotAxes.steps(low, high, 4);
    for (const tick of ticks) {
      const at = Math.round(y(tick)) + 0.5;
      line(left, at, left + width, at, grid);
      pen.fillText(label(tick), left - 7, at + 3.5);
    }
    pen.textAlign = "center";
    const clock = PlotAxes.clock(start, end, width);
    for (const tick of clock.ticks) {
      if (x(tick) > left + 2) pen.fillText(clock.label(tick), x(tick), PlotAxes.HEIGHT - 6);
    }
    pen.textAlign = "right";
    pen.fillText("t [s]", left + width, PlotAxes.HEIGHT - 6);
    this.drawUnit(pen, top + height / 2);
    line(left, top + height + 0.5, left + width, top + height + 0.5, muted);
  }

  // The unit, upright beside the axis.
  drawUnit(pen, middle) {
    const {unit} = this.definition;
    if (unit === "–") return;
    pen.save();
    pen.translate(9, middle);
    pen.rotate(-Math.PI / 2);
    pen.textAlign = "center";
    pen.fillText(`[${unit}]`, 0, 0);
    pen.restore();
  }

  // The values under the pointer, or else the present ones.
  drawCursor(pen, colors, {x, y, low, high, start, left, width, top, height}) {
    const {plots, pointer} = this;
    let row = plots.count - 1;
    const hovered = pointer !== null && plots.count > 0;
    if (hovered) {
      const time = start + (pointer - left) / width * LivePlots.SPAN;
      const next = Math.min(plots.find(time), plots.count - 1);
      const before = Math.max(next - 1, 0);
      row = time - plots.time(before) < plots.time(next) - time ? before : next;
      const at = x(plots.time(row));
      if (at >= left - 1) {
        pen.strokeStyle = colors.ink;
        pen.lineWidth = 1.2;
        pen.beginPath();
        pen.moveTo(at, top);
        pen.lineTo(at, top + height);
        pen.stroke();
      }
    }
    this.frame.moment.textContent = hovered ? `t = ${plots.time(row).toFixed(2)} s` : "";
    this.definition.series.forEach(({color}, k) => {
      const value = row >= 0 ? this.value(row, k) : NaN;
      const shown = this.definition.log ? 10 ** value : value;
      this.frame.outputs[k].textContent = PlotAxes.number(shown);
      if (row < 0 || !(value >= low && value <= high)) return;
      if (!this.frame.shows(k)) return;
      pen.beginPath();
      pen.arc(x(plots.time(row)), y(value), hovered ? 3.2 : 2.6, 0, 2 * Math.PI);
      pen.fillStyle = LivePlot.inkOf(color, colors);
      pen.fill();
    });
  }

  // The palette's ink is that of the page, light on dark.
  static inkOf(color, {ink}) { return color.toUpperCase() === "#22272B" ? ink : color; }
}
