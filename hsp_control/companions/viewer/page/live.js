// The plots of the live page: a run's, while it is computed and after, in `side`; see
// viewer/page_plots.py. And those of `hsp play`: the last seconds of every curve, in LivePlots.
"use strict";

{
  let side = null;  // none before there are plots: a page without a run keeps its look
  const names = make("ul", {className: "run-names"});  // several runs, with the lines of their curves

  commandHandlers.plots = ({arrays, plots}) => {
    if (!side) {
      side = new Side(player);
      side.box.append(names);
      if (matchMedia("(max-width: 560px)").matches) side.toggle();  // the scene needs the space
    }
    side.show(withArrays(plots, arrays.map(unpackArray)));
    names.hidden = plots.runs.length < 2;
    names.replaceChildren(...plots.runs.map((name, k) => make("li", {}, Side.sample(k), name)));
  };

  commandHandlers.no_plots = () => side?.clear();
}

// Rows of all series of all plots, in order. A time that jumps back clears them; a gap in time, as
// after a page has stalled, is drawn as one. Drawn at most 20 times a second, and not while the
// panel is closed, the page is hidden, or a plot is scrolled out of sight.
class LivePlots {
  static SPAN = 10;  // s
  static GAP = 0.3;  // s without a row
  static PERIOD = 50;  // ms

  constructor(parent, definitions, isOpen) {
    Object.assign(this, {isOpen, width: 0});
    this.plots = definitions.map((definition) => {
      const first = this.width;
      this.width += definition.series.length;
      return new LivePlot(this, definition, first);
    });
    this.clear();
    parent.replaceChildren(...this.plots.map(({box}) => box));
    this.timer = setInterval(() => this.draw(), LivePlots.PERIOD);
  }

  dispose() { clearInterval(this.timer); }

  clear() {
    Object.assign(this, {times: [], rows: []});  // rows as `add` gets them; null: a gap
    for (const plot of this.plots) plot.stale = true;
  }

  add(times, values) {
    const {width} = this;
    times.forEach((time, k) => {
      const step = time - (this.times.at(-1) ?? -Infinity);
      if (Math.abs(step) < 1e-9) return;  // the same row again
      if (step < 0) this.clear();
      else if (step > LivePlots.GAP && this.times.length) this.put(time - 1e-6, null);
      this.put(time, values.subarray(k * width, (k + 1) * width));
    });
    const old = this.times.findIndex((time) => time > this.end - LivePlots.SPAN - 1);
    if (old > 100) for (const kept of [this.times, this.rows]) kept.splice(0, old);
    for (const plot of this.plots) plot.stale = true;
  }

  put(time, row) {
    this.times.push(time);
    this.rows.push(row);
  }

  get end() { return this.times.at(-1) ?? 0; }

  draw() {
    if (!this.isOpen() || document.hidden) return;
    for (const plot of this.plots) {
      const {top, bottom} = plot.box.getBoundingClientRect();
      if (bottom > 0 && top < innerHeight) plot.update();
    }
  }
}

class LivePlot extends Plot {
  constructor(plots, definition, first) {
    super("h3", definition, definition.series);
    Object.assign(this, {plots, log: definition.log, first, known: [NaN, NaN]});
    const ariaLabel = `${definition.title}, the last ${LivePlots.SPAN} s`;
    Object.assign(this.figure, {role: "img", ariaLabel});
  }

  value(row, k) {
    const value = this.plots.rows[row]?.[this.first + k] ?? NaN;
    const shown = this.log ? Math.log10(value) : value;
    return Number.isFinite(shown) ? shown : null;
  }

  data() {
    const {times, rows} = this.plots;
    return [times, ...this.entries.map((_, k) => rows.map((_, row) => this.value(row, k)))];
  }

  build() {
    if (!this.figure.clientWidth) return;
    const {plots} = this, shades = this.entries.map(({color}) => Plot.shade(color));
    const newest = {show: true, size: 5, filter: () => [plots.times.length - 1]};
    this.known = [NaN, NaN];
    this.draw(this.data(), {
      logarithmic: this.log,
      series: shades.map((stroke, k) => (
        {stroke, width: 1.6, show: this.shows(k), points: {...newest, fill: stroke}})),
      scales: {
        x: {time: false, range: () => [0, LivePlots.SPAN].map(
          (t) => t + Math.max(plots.end - LivePlots.SPAN, 0))},
        y: {range: (_, least, most) => this.range(least, most)},
      },
      cursor: {points: {size: 7, width: 0, fill: (_, k) => shades[k - 1]}},
      hooks: {setCursor: [() => this.showValues()]},
    });
  }

  update() {
    if (!this.chart) this.build();
    this.fit();
    if (!this.stale || !this.chart) return;
    this.stale = false;
    this.chart.setData(this.data());
    this.showValues();
  }

  // The range of the axis: it grows at once, and shrinks when much of it is unused.
  range(low, high) {
    if (low === null) return this.log ? [-3, 0] : [0, 1];
    if (this.log) {
      const least = Math.max(Math.floor(low - 0.05), -9);  // below is nothing to see
      return [least, Math.max(Math.ceil(high + 0.05), least + 1)];
    }
    const size = Math.max(Math.abs(low), Math.abs(high), 5e-8), [from, to] = this.known;
    const room = Math.max(high - low, 0.02 * size), middle = (low + high) / 2;
    if (!(low >= from && high <= to && room > 0.55 * (to - from))) {
      this.known = [middle - 0.62 * room, middle + 0.62 * room];
    }
    return this.known;
  }

  // The values under the pointer, or else the present ones.
  showValues() {
    if (!this.chart) return;
    const {left, idx} = this.chart.cursor, {times} = this.plots;
    const hovered = left >= 0 && idx !== null, row = hovered ? idx : times.length - 1;
    this.moment.textContent = hovered ? `t = ${times[row].toFixed(2)} s` : "";
    this.outputs.forEach((output, k) => {
      const value = this.value(row, k);
      output.textContent = Plot.number(value === null || !this.log ? value : 10 ** value);
    });
  }
}
