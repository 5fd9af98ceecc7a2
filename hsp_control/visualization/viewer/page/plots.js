// The plots beside the scene: curves over time, and a cursor at the player's time.
//
//   const plots = new Plots(player, side, {runs, start, end, damped, panels, colors});
//   plots.load({...});   // the same plots with more rows, or others; the zoom stays
//   plots.select(1);     // emphasise the curves of one run; null: of all
//
// with the data of viewer/packed/plot_packing.py.
//
//   hover                values of all curves at the time under the pointer, in all plots
//   click                go to that time
//   drag                 zoom to a span; from the cursor, or with a finger: move the time
//   pinch, ctrl + wheel  zoom; a wheel across moves the span
//   double click, Esc    the whole run again
//
// In a plot with the focus + and - zoom, Home shows the whole run; all other keys are the
// player's. All plots have the same span of time.
"use strict";

const SVG = "http://www.w3.org/2000/svg";

function svg(name, attributes, parent) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent?.append(element);
  return element;
}

class Plots {
  static FINEST = 1 / 500;  // the shortest span, over the whole one

  // The line by which the plots tell the runs apart.
  static sample(run) {
    const picture = svg("svg", {viewBox: "0 0 22 8", "aria-hidden": "true"});
    svg("line", {x1: 2, x2: 20, y1: 4, y2: 4, stroke: "currentColor", "stroke-width": 2.2,
                 "stroke-linecap": run ? "round" : "butt",
                 "stroke-dasharray": Plot.dashes(run)}, picture);
    return picture;
  }

  constructor(player, parent, data) {
    Object.assign(this, {player, parent, plots: [], selected: null, hovered: null, under: null});
    this.whole = document.createElement("button");
    this.whole.type = "button";
    this.whole.className = "whole-run";
    this.whole.hidden = true;
    this.whole.title = "Show the whole run (Esc)";
    this.whole.onclick = () => this.reset();
    parent.append(this.whole);
    this.load(data);
    player.addEventListener("time", () => this.showTime());
    addEventListener("keydown", ({key}) => { if (key === "Escape") this.reset(); });
    new ResizeObserver(() => this.draw()).observe(parent);
  }

  // Show other data. Plots with the same curves are kept, and with them the focus and what the
  // user drags; so are a span that is zoomed, and a curve that is shown alone.
  load({runs, start, end, damped, panels, colors}) {
    const {zoomed, parent} = this;
    Object.assign(this, {runs, start, damped, colors, end: end > start ? end : start + 1});
    if (!zoomed) [this.from, this.to] = [this.start, this.end];
    const fit = panels.length === this.plots.length
      && panels.every((panel, k) => this.plots[k].fits(panel));
    if (fit) panels.forEach((panel, k) => this.plots[k].load(panel));
    else {
      const {scrollTop} = parent, before = this.plots;
      for (const {frame} of before) frame.box.remove();
      Object.assign(this, {hovered: null, under: null});
      this.plots = panels.map((panel, k) => new Plot(this, parent, panel, `plot-${k}`));
      for (const plot of this.plots) {
        plot.isolateAs(before.find(({panel}) => panel.title === plot.panel.title));
      }
      parent.scrollTop = scrollTop;
    }
    if (zoomed) this.zoom(this.from, this.to); else this.draw();
  }

  get zoomed() { return this.from > this.start || this.to < this.end; }

  // Show a span of time [s] in all plots, as far as it is in the run.
  zoom(from, to) {
    const longest = this.end - this.start;
    const length = Math.min(Math.max(to - from, Plots.FINEST * longest), longest);
    const middle = (from + to) / 2;
    this.from = Math.min(Math.max(middle - length / 2, this.start), this.end - length);
    this.to = this.from + length;
    if (length > 0.999 * longest) [this.from, this.to] = [this.start, this.end];
    this.draw();
  }

  // Magnify by a factor; the given time keeps its place.
  magnify(factor, time) {
    this.zoom(time - (time - this.from) / factor, time + (this.to - time) / factor);
  }

  reset() { if (this.zoomed) this.zoom(this.start, this.end); }

  // Emphasise the curves of one run; null: of all.
  select(run) {
    this.selected = run;
    this.draw();
  }

  // Show the values at a time under the pointer; null: at the player's again.
  hover(time, under = null) {
    Object.assign(this, {hovered: time, under});
    for (const plot of this.plots) plot.showValues();
  }

  draw() {
    this.whole.hidden = !this.zoomed;
    this.whole.textContent = `${this.from.toFixed(2)} – ${this.to.toFixed(2)} s   ✕`;
    for (const plot of this.plots) plot.draw();
    this.showTime();
  }

  showTime() {
    const {time} = this.player;
    const focused = this.plots.some(({picture}) => picture === document.activeElement);
    if (focused && this.zoomed && (time < this.from || time > this.to)) {
      const half = (this.to - this.from) / 2;
      this.zoom(time - half, time + half);  // which shows the time
      return;
    }
    for (const plot of this.plots) plot.showTime(time);
  }
}

class Plot {
  static MOVED = 4;  // a pointer that moves less is a click [px]
  static NEAR = 7;  // where the cursor can be taken [px]

  // The dashes of a curve, which tell the runs apart: solid, dotted, dashes and dots.
  static dashes(run, dashed) {
    if (!run) return dashed ? "5 3" : "none";
    const dots = run % 2 ? "0.1 3.6" : "0.1 3.6 0.1 3.6 8 3.6";
    return dashed ? `5 3.6 ${dots}` : dots;
  }

  constructor(plots, parent, panel, name) {
    Object.assign(this, {plots, name, pointers: new Map(), action: null, range: null});
    this.picture = svg("svg", {role: "slider", tabindex: 0, "aria-label": `${panel.title}, time`});
    this.load(panel);
    const {title, note} = panel;
    this.frame = new PlotBox("h2", {title, note, series: this.entries}, this.picture);
    this.frame.onisolate = () => {
      this.draw();
      this.showTime(plots.player.time);
    };
    parent.append(this.frame.box);
    this.listen();
  }

  // Take other data; the legend stays, and so must the names of the curves: see `fits`.
  load(panel) {
    this.panel = panel;
    this.entries = Plot.entriesOf(panel);
  }

  // One entry for the curves of the same name.
  static entriesOf({series}) {
    const entries = [];
    for (const each of series) {
      const known = entries.find((entry) => entry.name === each.name);
      if (known) known.curves.push(each);
      else entries.push({...each, curves: [each]});
    }
    return entries;
  }

  // Whether a panel has the same title and the same legend.
  fits(panel) {
    const told = (each, entries) => JSON.stringify([each.title, each.note, entries.map(
      ({name, color, dashed, band}) => [name, color, dashed, band])]);
    return told(panel, Plot.entriesOf(panel)) === told(this.panel, this.entries);
  }

  // Show alone what another plot shows alone.
  isolateAs(other) {
    if (!other || other.frame.alone === null) return;
    const {name} = other.entries[other.frame.alone];
    const place = this.entries.findIndex((entry) => entry.name === name);
    if (place >= 0) this.frame.isolate(place);
  }

  // -- the picture --

  // The coordinates of a time and a value in the plot, and the time at a place on the screen.
  x(time) {
    const {from, to} = this.plots;
    return PlotAxes.MARGIN.left + (time - from) / (to - from) * this.width;
  }

  y(value) {
    const [low, high] = this.range;
    return PlotAxes.MARGIN.top + (high - value) / (high - low) * this.height;
  }

  timeAt(clientX) {
    const {from, to} = this.plots;
    const x = clientX - this.picture.getBoundingClientRect().left - PlotAxes.MARGIN.left;
    return from + Math.min(Math.max(x / this.width, 0), 1) * (to - from);
  }

  // The curves that are shown, the emphasised ones last.
  curves() {
    const {selected} = this.plots;
    const shown = this.entries.filter((_, k) => this.frame.shows(k)).flatMap((e) => e.curves);
    const rank = ({run, band}) => (band ? 0 : 2) + (run === selected ? 1 : 0);
    return shown.sort((one, other) => rank(one) - rank(other));
  }

  // The axis: the packed range; of a part of the curves, or of time, what that part needs.
  limits(curves) {
    const {low, high, logarithmic, edges} = this.panel;
    if (!this.plots.zoomed && this.frame.alone === null) return [low, high];
    const {from, to} = this.plots;
    let least = Infinity, most = -Infinity;
    const measured = curves.filter(({predicted}) => !predicted);
    for (const curve of measured.length ? measured : curves) {
      const {times, values} = curve;
      const seen = [valueAt(curve, from), valueAt(curve, to)];
      times.forEach((time, i) => { if (time >= from && time <= to) seen.push(values[i]); });
      for (const value of seen) {
        if (value === null) continue;
        // Values beyond the whole axis are clipped: they say nothing about the range.
        least = Math.min(least, Math.max(value, low));
        most = Math.max(most, Math.min(value, high));
      }
    }
    if (!(least <= most)) return [low, high];
    for (const {value} of edges) [least, most] = [Math.min(least, value), Math.max(most, value)];
    const needed = logarithmic ? 1 : (high - low) / 1000;
    const room = 0.08 * (most - least) + Math.max(0, needed - (most - least)) / 2;
    return [least - room, most + room];
  }

  draw() {
    const {panel, picture, plots} = this;
    const {left, right, top, bottom} = PlotAxes.MARGIN;
    const full = picture.clientWidth;
    if (!full) return;
    this.width = full - left - right;
    this.height = PlotAxes.HEIGHT - top - bottom;
    const curves = this.curves();
    this.range = this.limits(curves);
    picture.replaceChildren();
    picture.setAttribute("viewBox", `0 0 ${full} ${PlotAxes.HEIGHT}`);
    const inside = svg("clipPath", {id: this.name}, picture);
    svg("rect", {x: left, y: top - 2, width: this.width, height: this.height + 3}, inside);
    this.drawAxes();
    const drawn = svg("g", {"clip-path": `url(#${this.name})`}, picture);
    for (const curve of curves) this.drawCurve(curve, drawn);
    this.span = svg("rect", {class: "span", y: top, height: this.height, visibility: "hidden"},
                    picture);
    this.cursor = this.drawCursor("cursor");
    this.pointed = this.drawCursor("pointed");
    picture.setAttribute("aria-valuemin", plots.start);
    picture.setAttribute("aria-valuemax", plots.end);
    this.showValues();
    if (panel.unit === "–") return;
    svg("text", {x: 0, y: 0, "text-anchor": "middle", class: "unit",
                 transform: `translate(9 ${top + this.height / 2}) rotate(-90)`}, picture)
      .textContent = `[${panel.unit}]`;
  }

  drawAxes() {
    const {panel, picture, plots, width, height} = this;
    const {left, top} = PlotAxes.MARGIN;
    const {muted, grid, contact, warning} = plots.colors;
    plots.damped.forEach((spans, run) => {
      if (plots.selected !== null && plots.selected !== run) return;
      for (const [from, to] of spans) {
        const x = this.x(from);
        const band = svg("rect", {x, y: top, width: Math.max(this.x(to) - x, 1), height,
                                  fill: warning, opacity: 0.15, class: "damped",
                                  "clip-path": `url(#${this.name})`}, picture);
        svg("title", {}, band).textContent = "damped near a singularity";
      }
    });
    const text = (attributes, content) => {
      svg("text", attributes, picture).textContent = content;
    };
    const across = (y, stroke) => svg(
      "line", {x1: left, x2: left + width, y1: y, y2: y, stroke}, picture);
    const [low, high] = this.range;
    const {ticks, label} = panel.logarithmic
      ? PlotAxes.decades(low, high) : PlotAxes.steps(low, high, 4);
    for (const tick of ticks) {
      const y = this.y(tick);
      across(y, grid);
      text({x: left - 7, y: y + 3.5, "text-anchor": "end"}, label(tick));
    }
    const floor = top + height, base = PlotAxes.HEIGHT - 6;
    const clock = PlotAxes.clock(plots.from, plots.to, width);
    for (const tick of clock.ticks) {
      const x = this.x(tick);
      svg("line", {x1: x, x2: x, y1: floor, y2: floor + 3, stroke: muted}, picture);
      text({x, y: base, "text-anchor": "middle"}, clock.label(tick));
    }
    text({x: left + width, y: base, "text-anchor": "end", class: "unit"}, "t [s]");
    for (const {value, name} of panel.edges) {
      const y = this.y(value);
      across(y, contact);
      if (name) text({...this.freest(value), y: y - 4, class: "edge"}, name);
    }
    across(floor, muted);
  }

  // Where a label above a line hides least of the curves: at the left, middle or right.
  freest(height) {
    const {left} = PlotAxes.MARGIN, {from, to} = this.plots;
    const room = (start) => Math.min(...this.curves().flatMap((curve) =>
      [0, 0.25, 0.5, 0.75, 1].map((part) => {
        const value = valueAt(curve, from + (start + 0.3 * part) * (to - from));
        return value === null ? Infinity : Math.abs(value - height);
      })));
    const [start] = [0.7, 0.35, 0].sort((one, other) => room(other) - room(one));
    const anchor = {0.7: "end", 0.35: "middle", 0: "start"}[start];
    const place = {0.7: this.width - 2, 0.35: this.width / 2, 0: 2}[start];
    return {x: left + place, "text-anchor": anchor};
  }

  drawCurve({times, values, color, dashed, band, run}, parent) {
    const {selected, from, to} = this.plots;
    // Only what is in the span, and one point on each side.
    let first = 0, last = times.length - 1;
    while (first + 1 < times.length && times[first + 1] <= from) first++;
    while (last > 0 && times[last - 1] >= to) last--;
    const points = [];
    for (let i = first; i <= last; i++) {
      points.push(`${this.x(times[i]).toFixed(1)},${this.y(values[i]).toFixed(1)}`);
    }
    const strength = selected === null || selected === run ? 1 : 0.3;
    const group = svg("g", {opacity: strength, "data-run": run}, parent);
    if (band) {
      const floor = PlotAxes.MARGIN.top + this.height;
      const ends = [this.x(times[last]), this.x(times[first])].map((x) => `${x},${floor}`);
      svg("polygon", {points: [...points, ...ends].join(" "), fill: color, opacity: 0.2}, group);
    }
    svg("polyline", {points: points.join(" "), fill: "none", stroke: color,
                     "stroke-width": band ? 1 : run ? 1.9 : 1.6, "stroke-linejoin": "round",
                     "stroke-linecap": run ? "round" : "butt",
                     "stroke-dasharray": Plot.dashes(run, dashed)}, group);
  }

  // A vertical line with a dot on each curve; hidden until it has a time.
  drawCursor(kind) {
    const {top} = PlotAxes.MARGIN;
    const group = svg("g", {class: kind, visibility: "hidden"}, this.picture);
    svg("line", {y1: top, y2: top + this.height, stroke: this.plots.colors.ink}, group);
    const dots = this.entries.flatMap(({curves}, place) => curves
      .filter(({band}) => !band).map((curve) => ({
        curve, place, dot: svg("circle", {r: 3.2, fill: curve.color, stroke: "#FFFFFF",
                                          "stroke-width": 1.2}, group),
      })));
    return {group, dots};
  }

  moveCursor({group, dots}, time) {
    const {from, to, selected} = this.plots;
    const seen = time !== null && time >= from - 1e-9 && time <= to + 1e-9;
    group.setAttribute("visibility", seen ? "visible" : "hidden");
    if (time === null) return;
    group.setAttribute("transform", `translate(${this.x(time).toFixed(2)} 0)`);
    group.dataset.time = time;
    for (const {curve, place, dot} of dots) {
      const value = valueAt(curve, time);
      const [low, high] = this.range;
      const hidden = value === null || value < low || value > high || !this.frame.shows(place)
        || (selected !== null && selected !== curve.run);
      dot.style.display = hidden ? "none" : "";
      if (!hidden) dot.setAttribute("cy", this.y(value));
    }
  }

  showTime(time) {
    if (!this.range) return;
    this.moveCursor(this.cursor, time);
    this.showValues();
  }

  // The values in the legend: under the pointer, or else at the player's time.
  showValues() {
    if (!this.range) return;
    const {hovered, under, player, selected, runs} = this.plots;
    const time = hovered ?? player.time;
    this.moveCursor(this.pointed, hovered);
    this.frame.moment.textContent = under === this ? `t = ${time.toFixed(2)} s` : "";
    this.frame.box.classList.toggle("hovered", hovered !== null);
    const told = this.entries.map(({name, curves}, k) => {
      const shown = runs.map((_, run) => run)
        .filter((run) => selected === null || selected === run);
      const text = shown.map((run) => {
        const curve = curves.find((each) => each.run === run);
        const value = curve ? valueAt(curve, time) : null;
        return value === null ? "–"
          : PlotAxes.number(this.panel.logarithmic ? 10 ** value : value);
      }).join(" | ");
      this.frame.outputs[k].textContent = text;
      return `${name} ${text}`;
    });
    if (this.picture !== document.activeElement) return;
    this.picture.setAttribute("aria-valuenow", time);
    this.picture.setAttribute("aria-valuetext", `t = ${time.toFixed(2)} s: ${told.join(", ")}`);
  }

  // -- what the user does --

  listen() {
    const {picture, plots} = this;
    // A click of the mouse must not take the keyboard from the player.
    picture.addEventListener("mousedown", (event) => event.preventDefault());
    picture.addEventListener("pointerdown", (event) => this.press(event));
    picture.addEventListener("pointermove", (event) => this.move(event));
    picture.addEventListener("pointerup", (event) => this.release(event));
    picture.addEventListener("pointercancel", (event) => this.release(event, true));
    picture.addEventListener("pointerleave", () => plots.hover(null));
    picture.addEventListener("dblclick", () => plots.reset());
    picture.addEventListener("wheel", (event) => this.wheel(event), {passive: false});
    picture.addEventListener("keydown", (event) => this.key(event));
    picture.addEventListener("focus", () => this.showValues());
  }

  // Whether a pointer is at the cursor, which it can take.
  atCursor({clientX, pointerType}) {
    const left = this.picture.getBoundingClientRect().left;
    return pointerType === "mouse"
      && Math.abs(clientX - left - this.x(this.plots.player.time)) < Plot.NEAR;
  }

  press(event) {
    if (event.button || !this.range) return;
    this.pointers.set(event.pointerId, event.clientX);
    this.picture.setPointerCapture(event.pointerId);
    if (this.pointers.size === 2) {
      const times = [...this.pointers].map(([id, x]) => [id, this.timeAt(x)]);
      this.stop();
      this.action = {kind: "pinch", times: new Map(times)};
    } else if (this.pointers.size === 1) {
      this.action = {kind: "click", x: event.clientX, y: event.clientY,
                     atCursor: this.atCursor(event)};
    }
  }

  move(event) {
    if (!this.range) return;
    const {plots, action} = this;
    if (this.pointers.has(event.pointerId)) this.pointers.set(event.pointerId, event.clientX);
    if (!action || !this.pointers.size) {
      this.picture.classList.toggle("at-cursor", this.atCursor(event));
      plots.hover(this.timeAt(event.clientX), this);
      return;
    }
    if (action.kind === "click" && Math.abs(event.clientX - action.x) > Plot.MOVED) {
      if (action.atCursor || event.pointerType !== "mouse") this.take();
      else this.action = {kind: "span", x: action.x};
    }
    if (this.action.kind === "time") plots.player.seek(this.timeAt(event.clientX));
    if (this.action.kind === "span") this.showSpan(event.clientX);
    if (this.action.kind === "pinch") this.pinch();
  }

  // Take the cursor: the player pauses as long as it is held.
  take() {
    const {player} = this.plots;
    this.action = {kind: "time", resume: player.playing};
    player.pause();
    this.plots.hover(null);
  }

  showSpan(clientX) {
    const [from, to] = [this.action.x, clientX].map((x) => this.timeAt(x)).sort((a, b) => a - b);
    Object.assign(this.action, {from, to});
    this.span.setAttribute("x", this.x(from));
    this.span.setAttribute("width", this.x(to) - this.x(from));
    this.span.setAttribute("visibility", "visible");
    this.plots.hover(this.timeAt(clientX), this);
  }

  // Two fingers keep the times that they have touched.
  pinch() {
    const [[one, x1], [other, x2]] = [...this.pointers];
    const t1 = this.action.times.get(one), t2 = this.action.times.get(other);
    if (Math.abs(x2 - x1) < 12 || (x2 - x1) * (t2 - t1) <= 0) return;
    const rate = (t2 - t1) / (x2 - x1);  // s per pixel
    const left = this.picture.getBoundingClientRect().left + PlotAxes.MARGIN.left;
    const from = t1 - rate * (x1 - left);
    this.plots.zoom(from, from + rate * this.width);
  }

  release(event, cancelled = false) {
    if (!this.pointers.delete(event.pointerId) || this.pointers.size) return;
    const {plots, action} = this;
    this.stop();
    if (event.pointerType !== "mouse") plots.hover(null);
    if (cancelled || !action) return;
    if (action.kind === "click") plots.player.seek(this.timeAt(action.x));
    if (action.kind === "span" && action.to > action.from) plots.zoom(action.from, action.to);
  }

  stop() {
    if (this.action?.resume) this.plots.player.play();
    this.span.setAttribute("visibility", "hidden");
    this.action = null;
  }

  // A plain wheel scrolls the page; a trackpad's pinch is a wheel with ctrl.
  wheel(event) {
    const {plots} = this;
    const zooms = event.ctrlKey || event.metaKey;
    const shifts = plots.zoomed && Math.abs(event.deltaX) > Math.abs(event.deltaY);
    if (!this.range || !(zooms || shifts)) return;
    event.preventDefault();
    if (zooms) plots.magnify(Math.exp(-event.deltaY / 200), this.timeAt(event.clientX));
    else {
      const by = event.deltaX / this.width * (plots.to - plots.from);
      const shift = Math.min(Math.max(by, plots.start - plots.from), plots.end - plots.to);
      plots.zoom(plots.from + shift, plots.to + shift);
    }
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const {plots} = this;
    const {time} = plots.player;
    const about = Math.min(Math.max(time, plots.from), plots.to);
    const actions = {
      "+": () => plots.magnify(2, about),
      "=": () => plots.magnify(2, about),
      "-": () => plots.magnify(0.5, about),
    };
    if (plots.zoomed) actions.Home = () => plots.reset();  // else to the start: the player's
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    event.stopPropagation();  // else the player would take it
    action();
  }
}

// A curve's value at a time, interpolated linearly between two of its points; null after its
// end or before its start.
function valueAt({times, values}, time) {
  let low = 0, high = times.length - 1;
  if (time < times[0] - 1e-6 || time > times[high] + 1e-6) return null;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  const fraction = high > low ? (time - times[low]) / (times[high] - times[low]) : 0;
  return values[low] + Math.min(Math.max(fraction, 0), 1) * (values[high] - values[low]);
}
