// The player: moves the scene along a clip, and sends events with the time. It depends on
// neither a server nor a file: it needs a scene tree and a clip.
//
//   const player = new Player(viewer);        // a MeshCat.Viewer
//   player.load(clip);                        // shows the clip's start; plays if clip.play is set
//   player.seek(2.5);                         // shows t = 2.5 s, exactly and immediately
//   player.addEventListener("time", ({detail}) => cursor.moveTo(detail.time));
//
// A clip is what viewer/clip.py writes: clocks (times), tracks that refer to them, and bands for the
// time line. Before its first time and after its last one a track keeps its first and last value; all
// but "visible" are interpolated, quaternions spherically. A path that is not in the scene is ignored.
//
// Events: "time" (detail: {time, start, end}) when another time is shown; "state" when playing,
// speed, loop, the clip or the run that is seen has changed.
"use strict";

class Player extends EventTarget {
  static SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4, 8];

  constructor(viewer) {
    super();
    Object.assign(this, {viewer, speed: 1, loop: false, run: null});  // the run that is seen alone
    this.unload();
  }

  // The bands of what is seen: of several runs each with its run's name.
  get marks() {
    return [...this.bands.values()].filter(({run}) => this.run === null || run === this.run)
      .map(({name, caption, run, ...rest}) => {
        const whose = run && this.run === null ? `${run}: ` : "";
        return {...rest, name: whose + name, caption: whose + caption};
      });
  }

  // Show the bands of one run; null: of all.
  select(run) {
    this.run = run;
    this._emit("state");
  }

  // Remove the clip; the scene does not change.
  unload() {
    this.tracks = new Map();
    this.bands = new Map();
    this.time = this.start = this.end = this.horizon = 0;
    this.open = this.playing = this.loaded = false;
    this._emit("state");
  }

  // Replace the clip. With `keep`, time, speed and state of the last clip are kept.
  load(clip, keep = false) {
    const {time, playing} = this, kept = keep && this.loaded;
    this.tracks = new Map();
    this.bands = new Map();
    this.start = this.end = clip.start;
    this.loaded = true;
    if (!kept) {
      this.speed = clip.speed ?? this.speed;
      this.loop = clip.loop ?? this.loop;
      this.time = clip.start;
      this.playing = false;
    }
    this.extend(clip);
    if (kept) this.seek(time);
    if (kept ? playing : clip.play) this.play();
  }

  // Append an extension to the clip.
  extend(clip) {
    const copies = clip.clocks.map((clock) => Float64Array.from(clock));
    for (const {path, property, clock, values} of clip.tracks) {
      const key = `${path}\n${property}`;
      const track = this.tracks.get(key);
      if (track) track.append(copies[clock], values);
      else this.tracks.set(key, new Track(path, property, copies[clock], values));
    }
    for (const band of clip.bands ?? []) this._mark(band);
    this.end = Math.max(this.end, clip.end);
    this.horizon = Math.max(this.end, clip.horizon ?? clip.end);
    this.open = Boolean(clip.open);
    this.refresh();
    this._emit("state");
  }

  play() {
    if (!this.loaded || this.playing) return;
    if (this.time >= this.end && !this.open) this.seek(this.start);
    this.playing = true;
    this._emit("state");
    let last = performance.now();
    const frame = (now) => {
      if (this._frame !== frame || !this.playing) return;
      // A page that was hidden continues where it was: limit the step.
      this._advance(clamp((now - last) / 1000, 0, 0.25));
      last = now;
      if (this.playing) requestAnimationFrame(frame);
    };
    this._frame = frame;
    requestAnimationFrame(frame);
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this._emit("state");
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  // Show a time [s], limited to the clip.
  seek(time) {
    const {start, end} = this;
    this.time = clamp(time, start, end);
    this.refresh();
    this._emit("time", {time: this.time, start, end});
  }

  // Pause, and move by some seconds.
  step(seconds) {
    this.pause();
    this.seek(this.time + seconds);
  }

  setSpeed(speed) {
    this.speed = speed;
    this._emit("state");
  }

  faster() { this.setSpeed(Player.SPEEDS.find((x) => x > this.speed) ?? this.speed); }

  slower() { this.setSpeed(Player.SPEEDS.findLast((x) => x < this.speed) ?? this.speed); }

  setLoop(on) {
    this.loop = on;
    this._emit("state");
  }

  // Show one instant of some tracks, which replaces what they show now.
  pose(tracks) {
    for (const {path, property, values} of tracks) {
      new Track(path, property, [0], values).show(this.viewer, 0);
    }
    this.viewer.set_dirty();
  }

  // Show the current time again, after the scene has changed.
  refresh() {
    for (const track of this.tracks.values()) track.show(this.viewer, this.time);
    this.viewer.set_dirty();
  }

  _advance(seconds) {
    let next = this.time + seconds * this.speed;
    if (this.open) {
      // A run that is computed slower than real time: follow its end smoothly.
      const behind = Math.max(this.end - this.time, 0);
      next = Math.min(next, this.time + behind * Math.min(1, seconds / 0.3));
    } else if (next >= this.end) {
      if (this.loop && this.end > this.start) {
        next = this.start + (next - this.end) % (this.end - this.start);
      } else {
        next = this.end;
        this.playing = false;
      }
    }
    this.seek(next);
    if (!this.playing) this._emit("state");
  }

  // Add a band; what goes on where the last interval of its name ended is one with it.
  _mark({spans, ...band}) {
    const key = `${band.run}\n${band.name}`, known = this.bands.get(key)?.spans ?? [];
    for (const [from, to] of spans) {
      const last = known.at(-1);
      if (last && from <= last[1]) last[1] = Math.max(last[1], to);
      else known.push([from, to]);
    }
    this.bands.set(key, {...band, spans: known});
  }

  _emit(kind, detail = {}) { this.dispatchEvent(new CustomEvent(kind, {detail})); }
}

// A node of the scene tree; none is created.
function findNode(viewer, path) {
  return path.split("/").filter(Boolean)
    .reduce((node, name) => node?.children[name], viewer.scene_tree);
}

// The animation of one property of one node.
class Track {
  constructor(path, property, times, values) {
    Object.assign(this, {path, times, values, count: times.length});
    this.width = times.length ? values.length / times.length : 1;
    this.apply = Track.PROPERTIES[property] ?? (() => {});
    this._value = new Array(this.width).fill(0);
  }

  append(times, values) {
    this.times = grown(this.times, this.count, times);
    this.values = grown(this.values, this.count * this.width, values);
    this.count += times.length;
  }

  show(viewer, time) {
    const node = findNode(viewer, this.path);
    if (node) this.apply(node, time);
  }

  // The rows before and after a time, and the fraction of the way between them.
  bracket(time) {
    const {times, count} = this, [low, high] = bracketed(times, time, 0, count - 1);
    const fraction = high > low ? (time - times[low]) / (times[high] - times[low]) : 0;
    return [low, high, clamp(fraction, 0, 1)];
  }

  linear(time) {
    const [low, high, fraction] = this.bracket(time);
    const {values, width, _value} = this;
    for (let k = 0; k < width; k++) {
      const here = values[low * width + k];
      _value[k] = here + fraction * (values[high * width + k] - here);
    }
    return _value;
  }

  spherical(time) {
    const [low, high, fraction] = this.bracket(time);
    MeshCat.THREE.Quaternion.slerpFlat(
      this._value, 0, this.values, 4 * low, this.values, 4 * high, fraction);
    return this._value;
  }

  stepped(time) {
    const [low, high, fraction] = this.bracket(time);
    return this.values[(fraction >= 1 ? high : low) * this.width];
  }

  static PROPERTIES = {
    position({object}, time) { object.position.fromArray(this.linear(time)); },
    quaternion({object}, time) { object.quaternion.fromArray(this.spherical(time)); },
    scale({object}, time) {
      const scale = this.linear(time);
      object.scale.fromArray(scale.map((x) => x || 1e-9));  // a scale of 0 is not invertible
    },
    // Acts on the node's object, so that the node's switch in the legend remains the user's.
    visible({children}, time) {
      const thing = children["<object>"];
      if (thing) thing.object.visible = this.stepped(time) > 0.5;
    },
    color({object}, time) {
      const value = this.linear(time);
      eachMaterial(object, (material) => material.color?.fromArray(value));
    },
    // The number of drawn rings of a trail after its first: see scene.js.
    length({object}, time) { drawRings(object, this.linear(time)[0]); },
  };
}

// The places in ascending times before and after a time, between two places.
function bracketed(times, time, low = 0, high = times.length - 1) {
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  return [low, high];
}

function eachMaterial(object, use) {
  object.traverse(({material}) => {
    if (material) [material].flat(Infinity).forEach(use);
  });
}

// Append to the first `count` numbers of an array; its capacity doubles when it is full.
function grown(array, count, more) {
  let buffer = array;
  if (count + more.length > array.length) {
    buffer = new array.constructor(Math.max(2 * array.length, count + more.length));
    buffer.set(array.subarray(0, count));
  }
  buffer.set(more, count);
  return buffer;
}
