// A plot over time, drawn by uPlot (github.com/leeoniya/uPlot): what the plots of a run and those
// of `hsp play` share. The legend is below it, with values; a name shows its curve alone.

class Plot {
  static HEIGHT = 118;  // px
  // A whole number: uPlot scales the digits before "px" by the ratio of pixels.
  static FONT = '11px system-ui, "Segoe UI", "Helvetica Neue", Arial, sans-serif';
  // Colours of the palette on a dark background.
  static DARK = {"#22272B": "#E3E8EC", "#6B7680": "#A4AFB8", "#DFE3E6": "#2F373E",
                 "#0072B2": "#3B9FDB", "#882255": "#D8689B", "#FFFFFF": "#1B2025"};

  static shade(color) {
    return document.body.classList.contains("dark") ? Plot.DARK[color] ?? color : color;
  }

  // Entries of the legend: {name, color, dashed, band}.
  constructor(heading, {title, note, unit}, entries) {
    Object.assign(this, {title, unit, entries, alone: null});
    this.moment = make("time");  // right of the title
    this.figure = make("figure");
    this.outputs = entries.map(() => make("output", {ariaLive: "off"}));  // beside the names
    this.buttons = entries.map(({name, color, dashed, band}, k) => makeButton(
      {title: "Show this curve alone, or all", ariaPressed: false,
       style: `--color: ${Plot.shade(color)}`,
       className: dashed ? "dashed" : band ? "band" : ""},
      () => this.isolate(this.alone === k ? null : k), make("span", {}, name), this.outputs[k]));
    this.box = make("section", {className: "plot"},
      make(heading, {}, title, " ", make("small", {}, note ?? ""), this.moment), this.figure,
      make("ul", {}, ...this.buttons.map((button) => make("li", {}, button))));
  }

  // Show one curve alone, by its place; null: all.
  isolate(place) {
    this.alone = place;
    this.buttons.forEach((button, k) => {
      button.ariaPressed = place === k;
      button.classList.toggle("off", !this.shows(k));
    });
    this.build();
  }

  shows(place) { return this.alone === null || this.alone === place; }

  // Draw it anew, with options of uPlot beside those that all plots have.
  draw(data, {logarithmic, series, scales, cursor, hooks}) {
    const muted = Plot.shade("#6B7680"), grid = Plot.shade("#DFE3E6"), font = Plot.FONT;
    const axis = {stroke: muted, font, ticks: {stroke: muted, width: 1, size: 3}};
    const label = this.unit === "–" ? null : `[${this.unit}]`;
    const labelled = {label, labelFont: font, labelSize: 14, labelGap: 0};
    const {clientWidth, clientHeight} = this.figure;
    this.chart?.destroy();
    this.chart = null;  // events while the next one is made are not for the last one
    this.chart = new uPlot({
      width: clientWidth || 300, height: clientHeight || Plot.HEIGHT,
      padding: [6, 20, 0, label ? 0 : 14], legend: {show: false}, scales, hooks,
      series: [{}, ...series.map((each) => ({points: {show: false}, pxAlign: 0, ...each}))],
      axes: [
        {...axis, size: 20, gap: 2, space: 45, grid: {show: false}, values: Plot.numbers(" s"),
         border: {show: true, stroke: muted, width: 1}},
        {...axis, size: 46, gap: 4, space: 20, grid: {stroke: grid, width: 1}, ...labelled,
         ticks: {show: false}, ...(logarithmic ? Plot.DECADES : {values: Plot.numbers("")})},
      ],
      cursor: {y: false, drag: {x: false, y: false}, ...cursor,
               bind: {mousedown: () => null, mouseup: () => null, dblclick: () => null}},
    }, data, this.figure);
  }

  fit() {
    const {clientWidth} = this.figure;
    if (clientWidth && this.chart && this.chart.width !== clientWidth) {
      this.chart.setSize({width: clientWidth, height: this.chart.height});
    }
  }

  // Lines across a chart; the name of a line is left out where it stands already, or has no room.
  drawnLines(chart, lines) {
    const named = [];
    this.places ??= new Map();  // line -> where its name stands
    return lines.map(({value, name}) => {
      const top = Math.round(chart.valToPos(value, "y")), key = `${value} ${name}`;
      const again = named.some((other) => other.name === name && Math.abs(other.top - top) < 14);
      const place = name && !again ? Plot.placeOf(name, top, chart, named, this.places.get(key)) : null;
      this.places.set(key, place);
      if (place) named.push({name, top, ...place});
      const {side, below} = place ?? {side: "left", below: top < 16};
      return make("i", {className: below ? "edge below" : "edge",
                        style: `top: ${top}px; text-align: ${side}`},
                  ...place ? [make("span", {}, name)] : []);
    });
  }

  // Where the name of a line does not cover a curve, nor another name: its last place as long as that
  // is so, else the place that is farthest from the curves.
  static placeOf(name, top, {data, series, over, valToPos, posToIdx}, named, last) {
    const {clientWidth, clientHeight} = over, width = Math.min(10 + 6 * name.length, clientWidth);
    const shown = data.filter((_, k) => k > 0 && series[k].show);
    const starts = {left: 0, right: clientWidth - width, center: (clientWidth - width) / 2};
    const places = Object.entries(starts).flatMap(([side, start]) => [false, true].map((below) => {
      const middle = top + (below ? 8 : -8);
      const indices = Array.from({length: 25}, (_, k) => posToIdx(start + width * k / 24));
      const heights = indices.flatMap((i) => shown.map((curve) => curve[i] ?? null))
        .map((value) => value === null ? Infinity : Math.abs(valToPos(value, "y") - middle));
      return {side, below, start, width, middle, gap: Math.min(...heights)};
    })).filter(({start, middle}) => middle >= 8 && middle <= clientHeight - 8
      && named.every((other) => Math.abs(other.middle - middle) >= 14
        || other.start >= start + width || start >= other.start + other.width));
    return places.find(({side, below, gap}) => gap >= 9 && side === last?.side && below === last.below)
      ?? places.reduce((best, place) => place.gap > (best?.gap ?? -1) ? place : best, null);
  }

  // The labels of ticks; the last one has the unit.
  static numbers(unit) {
    return (_, ticks, axis, space, step) => {
      const digits = Math.min((String(step).split(".")[1] ?? "").length, 6);
      const text = (tick) => step < 1e-4 && tick ? tick.toExponential(1) : tick.toFixed(digits);
      const last = ticks.length - 1;
      return ticks.map((tick, k) => Plot.minus(text(tick)) + (k === last ? unit : ""));
    };
  }

  // Ticks where values are exponents of ten: at most five. uPlot has no steps of 3 or 4.
  static DECADES = {
    incrs: (_, axis, low, high) =>
      [[1, 2, 5, 10, 20].find((step) => step >= (high - low) / 4.5) ?? 50], space: 1,
    values: (_, ticks) => ticks.map((tick) => tick === 0 ? "1"
      : `10${[...String(tick)].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("")}`),
  };

  // A number, or one by its logarithm, with few characters, always of about the same width.
  static number(shown, logarithmic) {
    if (shown === null) return "–";
    const value = logarithmic ? 10 ** shown : shown, size = Math.abs(value);
    if (size < 1e-12) return "0";  // rounding
    return Plot.minus(size !== 0 && (size < 1e-3 || size >= 1e5)
      ? value.toExponential(1) : value.toFixed(size < 10 ? 3 : size < 1000 ? 1 : 0));
  }

  static minus(text) { return text.replace(/-/g, "−"); }
}
