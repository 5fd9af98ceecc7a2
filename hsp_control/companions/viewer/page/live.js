// The plots of the live page: a run's, while it is computed and after, in `side`; see
// viewer/page_plots.py. And those of `hsp play`: the last seconds of every curve, in LivePlots.
"use strict";

{
  let side = null;  // none before there are plots: a page without a run keeps its look

  commandHandlers.plots = ({arrays, plots}) => {
    if (!side) {
      side = new Side(player);
      if (matchMedia("(max-width: 560px)").matches) side.toggle();  // the scene needs the space
    }
    side.show(withArrays(plots, arrays.map(unpackArray)));
    const names = part(".run-names");  // with the lines of their curves
    names.hidden = plots.runs.length < 2;
    names.replaceChildren(...plots.runs.map((name, k) => make("li", {}, Side.sample(k), name)));
  };

  commandHandlers.no_plots = () => side?.clear();
}

// The last seconds of all series of all plots. A time that jumps back clears them; a gap in time, as
// after a page has stalled, is drawn as one. Drawn at most 20 times a second, and not while the
// panel is closed, the page is hidden, or a plot is scrolled out of sight.
class LivePlots {
  static SPAN = 10;  // s
  static GAP = 0.3;  // s without a row

  constructor(parent, definitions, isOpen) {
    Object.assign(this, {isOpen, plots: definitions.map((each) => new LivePlot(this, each))});
    this.clear();
    parent.replaceChildren(...this.plots.map(({box}) => box));
    this.timer = setInterval(() => this.draw(), 50);  // ms
  }

  dispose() { clearInterval(this.timer); }

  clear() {
    this.times = [];
    for (const plot of this.plots) plot.clear();
  }

  add(times, values) {
    const width = values.length / times.length;
    times.forEach((time, k) => {
      const step = time - (this.times.at(-1) ?? -Infinity);
      if (Math.abs(step) < 1e-9) return;  // the same row again
      if (step < 0) this.clear();
      else if (step > LivePlots.GAP && this.times.length) this.put(time - 1e-6, []);
      this.put(time, [...values.subarray(k * width, (k + 1) * width)]);
    });
    const old = this.times.findIndex((time) => time > this.end - LivePlots.SPAN - 1);
    if (old < 100) return;
    this.times.splice(0, old);
    for (const column of this.plots.flatMap(({columns}) => columns)) column.splice(0, old);
  }

  put(time, row) {
    this.times.push(time);
    for (const plot of this.plots) plot.put(row.splice(0, plot.columns.length));
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
  static NEAR = 0.8;  // of a limit: its line is drawn among several curves
  static REACHED = 0.95;  // of a limit: a value is marked

  constructor(plots, definition) {
    super("h3", definition, definition.series);
    const {log, lines = [], reaches = false} = definition;
    Object.assign(this, {plots, log, lines, reaches, marks: make("div", {className: "marks"})});
    const ariaLabel = `${definition.title}, the last ${LivePlots.SPAN} s`;
    Object.assign(this.figure, {role: "img", ariaLabel});
  }

  clear() { Object.assign(this, {columns: this.entries.map(() => []), stale: true}); }

  // Append a row; an empty one is a gap.
  put(row) {
    this.columns.forEach((column, k) => {
      const value = this.log ? Math.log10(row[k]) : row[k];
      column.push(Number.isFinite(value) ? value : null);
    });
    this.stale = true;
  }

  build() {
    if (!this.figure.clientWidth) return;
    const {plots} = this, shades = this.entries.map(({color}) => Plot.shade(color));
    const newest = {show: true, size: 5, filter: () => [plots.times.length - 1]};
    this.draw([plots.times, ...this.columns], {
      logarithmic: this.log,
      series: shades.map((stroke, k) => (
        {stroke, width: 1.6, show: this.shows(k), points: {...newest, fill: stroke}})),
      scales: {
        x: {time: false, range: () => [0, LivePlots.SPAN].map(
          (t) => t + Math.max(plots.end - LivePlots.SPAN, 0))},
        y: {range: (_, least, most) => this.range(least, most)},
      },
      cursor: {points: {size: 7, width: 0, fill: (_, k) => shades[k - 1]}},
      hooks: {setCursor: [() => this.showValues()], draw: [(chart) => this.drawLines(chart)]},
    });
  }

  // The lines of the shown curves; a curve that is shown alone has only its own.
  get ownLines() {
    return this.lines.filter(({curves}) => this.alone === null || curves.includes(this.alone));
  }

  // Whether a curve is near a line: all limits of many joints would hide the curves.
  isNear({value, curves}) {
    return this.reaches || this.alone !== null || curves.some((k) =>
      this.columns[k].some((own) => own !== null && own / value > LivePlot.NEAR));
  }

  // Limits and contacts within the axis, with their names.
  drawLines(chart) {
    const {min, max} = chart.scales.y;
    const inside = this.ownLines.filter((line) =>
      line.value >= min && line.value <= max && this.isNear(line));
    this.marks.replaceChildren(...this.drawnLines(chart, inside));
    chart.over.prepend(this.marks);
  }

  update() {
    if (!this.chart) this.build();
    this.fit();
    if (!this.stale || !this.chart) return;
    this.stale = false;
    this.chart.setData([this.plots.times, ...this.columns]);
    this.showValues();
  }

  // The range of the axis: not much finer than the values, or it would show their noise.
  range(low, high) {
    if (low === null) return this.log ? [-3, 0] : [0, 1];
    if (this.log) {
      const least = Math.max(Math.floor(low - 0.05), -9);  // smaller values are not shown
      return [least, Math.max(Math.ceil(high + 0.05), least + 1)];
    }
    if (Math.max(-low, high) < 1e-9) return [0, 1];  // nothing but rounding
    if (this.reaches || this.alone !== null) {
      const ends = this.ownLines.map(({value}) => value);
      [low, high] = [Math.min(low, ...ends), Math.max(high, ...ends)];
    }
    const size = Math.max(Math.abs(low), Math.abs(high), 5e-8), middle = (low + high) / 2;
    const half = Math.max(high - low, 0.02 * size) / 2;
    return uPlot.rangeNum(middle - half, middle + half, 0.1, false);
  }

  showValues() {
    if (!this.chart) return;
    const {left, idx} = this.chart.cursor, {times} = this.plots;
    const hovered = left >= 0 && idx !== null, row = hovered ? idx : times.length - 1;
    this.moment.textContent = hovered ? `t = ${times[row].toFixed(2)} s` : "";
    this.outputs.forEach((output, k) => {
      const value = this.columns[k][row] ?? null;
      output.textContent = Plot.number(value, this.log);
      output.classList.toggle("near", !this.reaches && value !== null && this.lines.some((line) =>
        line.curves.includes(k) && value / line.value > LivePlot.REACHED));
    });
  }
}
