// The plots beside the scene: curves of a run, or of several, and a cursor at the player's time; the
// data are those of viewer/page_plots.py. In a plot with the focus + and - zoom, Home shows the whole
// run; all other keys are the player's. All plots have the same span of time.
"use strict";

class Side {
  constructor(player) {
    Object.assign(this, {player, plots: [], selected: null, start: 0, end: 1, from: 0, to: 1});
    this.box = part("#side");
    this.whole = onPress(part(".whole-run"), () => this.reset());
    document.body.classList.add("sided", "without-plots");
    barHeight = 0;  // the bar is below the picture
    onPress(part(".player .side"), () => this.toggle());
    onKey(({key}) => key === "g" && !document.body.classList.contains("without-plots")
      && (() => this.toggle()));
    on(window, "keydown", ({key}) => { if (key === "Escape") this.reset(); });
    on(player, "time", () => this.showTime());
    new ResizeObserver(() => this.fit()).observe(this.box);
  }

  // Show or hide the plots; the scene takes their space.
  toggle() { document.body.classList.toggle("alone"); }
  // Remove them; whether the user wants to see any is kept.
  clear() { document.body.classList.add("without-plots"); }

  // Show other data; the user's changes of the plots stay, if they have the same curves.
  show({runs, start, end, damped, panels}) {
    document.body.classList.remove("without-plots");
    const {zoomed, plots} = this;
    Object.assign(this, {runs, start, damped, end: end > start ? end : start + 1});
    const looks = (each) => String(each.map(RunPlot.lookOf));
    if (looks(panels) !== looks(plots.map(({panel}) => panel))) this.replace(panels);
    panels.forEach((panel, k) => { this.plots[k].panel = panel; });
    this.zoom(...(zoomed ? [this.from, this.to] : [this.start, this.end]));
  }

  replace(panels) {
    const {scrollTop} = this.box, before = this.plots;
    for (const plot of before) plot.box.remove();
    this.plots = panels.map((panel) => new RunPlot(this, panel));
    this.box.append(...this.plots.map(({box}) => box));
    for (const plot of this.plots) {
      const known = before.find(({title}) => title === plot.title);
      const alone = known?.entries[known.alone]?.name;
      const place = plot.entries.findIndex(({name}) => name === alone);
      plot.isolate(place < 0 ? null : place);
    }
    this.box.scrollTop = scrollTop;
  }

  get zoomed() { return this.from > this.start || this.to < this.end; }

  // Show a span of time [s], as far as it is in the run.
  zoom(from, to) {
    const longest = this.end - this.start;
    const length = clamp(to - from, longest / 500, longest);
    this.from = clamp((from + to - length) / 2, this.start, this.end - length);
    this.to = this.from + length;
    if (length > 0.999 * longest) [this.from, this.to] = [this.start, this.end];
    this.whole.hidden = !this.zoomed;
    this.whole.textContent = `${this.from.toFixed(2)} – ${this.to.toFixed(2)} s   ✕`;
    for (const plot of this.plots) plot.refresh();
  }

  // Magnify; the given time keeps its place.
  magnify(factor, time) {
    this.zoom(time - (time - this.from) / factor, time + (this.to - time) / factor);
  }

  reset() { if (this.zoomed) this.zoom(this.start, this.end); }

  // Emphasise the curves of one run; null: of all.
  select(run) {
    this.selected = run;
    for (const plot of this.plots) plot.build();
  }

  fit() {
    for (const plot of this.plots) plot.fit();
    this.showTime();
  }

  showTime() {
    const {time} = this.player, {from, to} = this, half = (to - from) / 2;
    const focused = this.plots.some(({figure}) => figure === document.activeElement);
    const hidden = this.zoomed && (time < from || time > to);
    if (focused && hidden) this.zoom(time - half, time + half);
    for (const plot of this.plots) plot.showTime();
  }

  static sample(run) {
    const innerHTML = `<svg viewBox="0 0 22 8" aria-hidden="true"><line x1="2" x2="20" y1="4" y2="4"
      stroke="currentColor" stroke-width="2.2" stroke-linecap="${run ? "round" : "butt"}"
      stroke-dasharray="${RunPlot.dashes(run).join(" ")}"/></svg>`;
    return make("i", {innerHTML}).firstChild;
  }
}

class RunPlot extends Plot {
  static MOVED = 4;  // a pointer that moves less is a click [px]
  static NEAR = 7;  // where the cursor can be taken [px]

  static dashes(run, dashed) {  // solid, dotted, dashes and dots
    const dots = !run ? [] : run % 2 ? [0.1, 3.6] : [0.1, 3.6, 0.1, 3.6, 8, 3.6];
    return dashed ? [5, run ? 3.6 : 3, ...dots] : dots;
  }

  // Properties of a panel that change only with other plots.
  static lookOf({title, note, series}) {
    const look = ({name, run, color, dashed, band}) => [name, run, color, dashed, band];
    return JSON.stringify([title, note, series.map(look)]);
  }

  constructor(side, panel) {
    // Curves of one name have one entry of the legend.
    super("h2", panel, [...new Map(panel.series.map((each) => [each.name, each])).values()]);
    Object.assign(this, {side, panel, fingers: new Map(), drag: null, marks: make("div")});
    Object.assign(this.figure, {tabIndex: 0, role: "slider", ariaLabel: `${panel.title}, time`});
    this.listen();
  }

  build() {
    const {side, panel} = this;
    const rank = ({run, band}) => (band ? 0 : 2) + (run === side.selected ? 1 : 0);
    this.curves = panel.series.filter(({name}) => this.alone === null
      || this.entries[this.alone].name === name).sort((one, other) => rank(one) - rank(other));
    const shades = this.curves.map(({color}) => Plot.shade(color)), paper = Plot.shade("#FFFFFF");
    const pointed = ({band, run}) => !band && !this.faint(run);
    this.draw(this.data(), {
      logarithmic: panel.logarithmic,
      series: this.curves.map(({dashed, band, run, predicted}, k) => ({
        stroke: shades[k], width: band ? 1 : run ? 1.9 : 1.6, cap: run ? "round" : "butt",
        dash: RunPlot.dashes(run, dashed), alpha: this.faint(run) ? 0.3 : 1,
        auto: this.alone !== null || !predicted,
        ...(band && {fill: `${shades[k]}33`, fillTo: (u) => u.scales.y.min}),
      })),
      scales: {x: {time: false, range: () => [side.from, side.to]},
               y: {range: (_, least, most) => this.range(least, most)}},
      cursor: {sync: {key: "run"},
               points: {size: (_, k) => pointed(this.curves[k - 1]) ? 7 : 0,
                        fill: (_, k) => shades[k - 1], stroke: paper, width: 1}},
      hooks: {drawAxes: [(u) => this.drawMarks(u)], draw: [() => this.showTime()],
              setCursor: [() => this.showValues()]},
    });
    this.dots = shades.map((shade) => make("i", {style: `background: ${shade}`}));
    this.cursor = make("div", {className: "cursor"}, ...this.dots);
    this.chart.over.append(this.cursor);
  }

  faint(run) { return this.side.selected !== null && this.side.selected !== run; }

  // The curves at their corners, and about one time a pixel.
  data() {
    const {from, to} = this.side, count = this.figure.clientWidth || 300;
    const corners = this.curves.flatMap(({times}) => [...times.filter((t) => t > from && t < to)]);
    const even = Array.from({length: count + 1}, (_, k) => from + k / count * (to - from));
    const times = Float64Array.from(new Set([...even, ...corners])).sort();
    return [times, ...this.curves.map((curve) => Array.from(times, (t) => valueAt(curve, t)))];
  }

  refresh() {
    this.curves = this.curves.map(({name, run}) => this.find(name, run));
    this.chart.setData(this.data());
  }

  find(name, run) {
    return this.panel.series.find((each) => each.name === name && each.run === run);
  }

  // The axis: the packed range; of a part of the curves, or of time, the range of that part.
  range(least, most) {
    const {low, high, logarithmic, edges} = this.panel;
    if ((!this.side.zoomed && this.alone === null) || least === null) return [low, high];
    // Values beyond the whole axis are clipped: they do not determine the range.
    const ends = [least, most].map((value) => clamp(value, low, high));
    const needed = [...ends, ...edges.map(({value}) => value)];
    const from = Math.min(...needed), to = Math.max(...needed);
    const smallest = logarithmic ? 1 : (high - low) / 1000;
    const room = 0.08 * (to - from) + Math.max(0, smallest - (to - from)) / 2;
    return [from - room, to + room];
  }

  // Marks of when the law is damped near a singularity, and of where there is contact.
  drawMarks(chart) {
    const {damped} = this.side;
    const spans = damped.flatMap((each, run) => this.faint(run) ? [] : each);
    const singular = spans.map((ends) => {
      const [left, right] = ends.map((time) => chart.valToPos(time, "x"));
      return make("i", {className: "damped", style: `left: ${left}px; width: ${right - left}px`});
    });
    this.marks.replaceChildren(...singular, ...this.drawnLines(chart, this.panel.edges));
    chart.over.prepend(this.marks);
  }

  // The cursor at the player's time: a line, and a dot on each curve.
  showTime() {
    if (!this.chart) return;
    const {side, chart, cursor} = this, {time} = side.player, {min, max} = chart.scales.y;
    cursor.hidden = !(time >= side.from - 1e-9 && time <= side.to + 1e-9);
    cursor.dataset.time = time;
    cursor.style.transform = `translateX(${chart.valToPos(time, "x").toFixed(2)}px)`;
    this.curves.forEach((curve, k) => {
      const value = valueAt(curve, time), inside = value !== null && value >= min && value <= max;
      this.dots[k].hidden = !inside || curve.band || this.faint(curve.run);
      if (inside) this.dots[k].style.top = `${chart.valToPos(value, "y").toFixed(2)}px`;
    });
    this.showValues();
  }

  // The values in the legend: under the pointer, or else at the player's time.
  showValues() {
    if (!this.chart) return;
    const {side, panel, chart, figure} = this, {left} = chart.cursor, hovered = left >= 0;
    const time = hovered ? chart.posToVal(left, "x") : side.player.time;
    const moment = `t = ${time.toFixed(2)} s`;
    this.moment.textContent = hovered && figure.matches(":hover") ? moment : "";
    this.box.classList.toggle("hovered", hovered);
    const runs = [...side.runs.keys()].filter((run) => !this.faint(run));
    this.entries.forEach(({name}, k) => {
      this.outputs[k].textContent = runs.map((run) => {
        const curve = this.find(name, run), value = curve ? valueAt(curve, time) : null;
        return Plot.number(value, panel.logarithmic);
      }).join(" | ");
    });
    if (figure !== document.activeElement) return;
    const values = this.entries.map(({name}, k) => `${name} ${this.outputs[k].textContent}`);
    Object.assign(figure, {ariaValueMin: side.start, ariaValueMax: side.end, ariaValueNow: time,
                           ariaValueText: `${moment}: ${values.join(", ")}`});
  }

  listen() {
    const {figure} = this;
    // A mouse must not take the keyboard from the player, nor a tap leave a pointer behind.
    on(figure, "mousedown touchend", (event) => event.preventDefault());
    on(figure, "pointerdown", (event) => this.press(event));
    on(figure, "pointermove", (event) => this.move(event));
    on(figure, "pointerup pointercancel", (event) => this.release(event));
    on(figure, "dblclick", () => this.side.reset());
    on(figure, "wheel", (event) => this.wheel(event), {passive: false});
    on(figure, "keydown", (event) => this.key(event));
    on(figure, "focus", () => this.showValues());
  }

  // Where the curves are on the screen, and the time at a place there.
  get area() { return this.chart.over.getBoundingClientRect(); }

  timeAt(clientX) {
    const {left, width} = this.area, {from, to} = this.side;
    return from + clamp((clientX - left) / width, 0, 1) * (to - from);
  }

  // Whether a pointer is at the cursor, which it can take; a finger always can.
  takes({clientX, pointerType}) {
    const at = this.area.left + this.chart.valToPos(this.side.player.time, "x");
    return pointerType !== "mouse" || Math.abs(clientX - at) < RunPlot.NEAR;
  }

  press(event) {
    if (event.button) return;
    const {clientX: x, pointerId} = event, {fingers} = this;
    fingers.set(pointerId, {x});
    for (const finger of fingers.values()) finger.time = this.timeAt(finger.x);
    this.figure.setPointerCapture(pointerId);
    this.stop();
    if (fingers.size > 2) return;
    this.drag = {kind: fingers.size === 2 ? "pinch" : "click", x,
                 next: this.takes(event) ? "time" : "span"};
  }

  move(event) {
    const {drag, side, chart} = this, {clientX: x, pointerId} = event, {player} = side;
    if (!drag || !this.fingers.has(pointerId)) {
      this.figure.classList.toggle("at-cursor", this.takes(event));
      return;
    }
    this.fingers.get(pointerId).x = x;
    if (drag.kind === "click" && Math.abs(x - drag.x) > RunPlot.MOVED) {
      drag.kind = drag.next;
      drag.resume = drag.kind === "time" && player.playing;
      if (drag.resume) player.pause();  // as long as the cursor is held
    }
    if (drag.kind === "time") player.seek(this.timeAt(x));
    if (drag.kind === "pinch") this.pinch();
    if (drag.kind === "span") {
      drag.span = [drag.x, x].map((end) => this.timeAt(end)).sort((a, b) => a - b);
      const [left, right] = drag.span.map((time) => chart.valToPos(time, "x"));
      chart.setSelect({left, width: right - left, top: 0, height: this.area.height}, false);
    }
  }

  // Two fingers keep the times that they have touched.
  pinch() {
    const [one, other] = this.fingers.values(), apart = other.x - one.x;
    if (Math.abs(apart) < 12 || apart * (other.time - one.time) <= 0) return;
    const rate = (other.time - one.time) / apart;  // s per pixel
    const {left, width} = this.area, from = one.time - rate * (one.x - left);
    this.side.zoom(from, from + rate * width);
  }

  release({pointerId, type}) {
    if (!this.fingers.delete(pointerId) || this.fingers.size) return;
    const {side} = this, {kind, x, span} = this.drag ?? {};
    this.stop();
    if (type === "pointercancel") return;
    if (kind === "click") side.player.seek(this.timeAt(x));
    if (kind === "span" && span[1] > span[0]) side.zoom(...span);
  }

  stop() {
    if (this.drag?.resume) this.side.player.play();
    this.chart.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
    this.drag = null;
  }

  // A plain wheel scrolls the page; a trackpad's pinch is a wheel with ctrl.
  wheel(event) {
    const {side} = this, {deltaX, deltaY} = event;
    const zooms = event.ctrlKey || event.metaKey;
    if (!zooms && !(side.zoomed && Math.abs(deltaX) > Math.abs(deltaY))) return;
    event.preventDefault();
    if (zooms) return side.magnify(Math.exp(-deltaY / 200), this.timeAt(event.clientX));
    const by = deltaX / this.area.width * (side.to - side.from);
    const shift = clamp(by, side.start - side.from, side.end - side.to);
    side.zoom(side.from + shift, side.to + shift);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const {side} = this, about = clamp(side.player.time, side.from, side.to);
    const factor = {"+": 2, "=": 2, "-": 0.5}[event.key];
    if (factor) side.magnify(factor, about);
    else if (event.key === "Home" && side.zoomed) side.reset();  // else to the start: the player's
    else return;
    event.preventDefault();
    event.stopPropagation();  // else the player would take it
  }
}

// A curve's value at a time; null before its start, in its gaps and after its end.
function valueAt(curve, time) {
  const {times, values, gaps} = curve, end = times.at(-1) + 1e-6;
  if (time < times[0] - 1e-6 || time > end) return null;
  // A gap ends where the next value is; the last one, with the run.
  if (gaps.some(([from, to]) => time >= from && (time < to || to > end - 2e-6))) return null;
  curve.line ??= new MeshCat.THREE.LinearInterpolant(times, values, 1);
  return curve.line.evaluate(time)[0];
}
