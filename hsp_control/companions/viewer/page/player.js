// The player: moves the scene along a clip, without a server or a file.
//
// A clip is written by viewer/clip.py: clocks (times), tracks that refer to them, and bands for the
// time line. Before its first time and after its last one a track keeps its first and last value; all
// but "visible" are interpolated, quaternions spherically. A path that is not in the scene is ignored.
//
// Events: "time" (detail: {time}) when another time is shown; "state" when playing, speed, loop,
// the clip or the run that is seen has changed.
"use strict";

class Player extends EventTarget {
  static SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4, 8];

  constructor(viewer) {
    super();
    Object.assign(this, {viewer, speed: 1, loop: false, run: null});  // run: that is seen alone
    this.unload();
  }

  // Change speed, loop, or the run whose bands are shown (null: all).
  set(changes) {
    Object.assign(this, changes);
    this._emit("state");
  }

  // The bands of the visible things.
  get marks() {
    return [...this.bands.values()].filter(({run}) => this.run === null || run === this.run);
  }

  unload() {
    this.set({tracks: new Map(), bands: new Map(), time: 0, start: 0, end: 0, horizon: 0,
              open: false, playing: false, loaded: false});
  }

  // Replace the clip. With `keep`, time, speed and state of the last clip are kept.
  load(clip, keep = false) {
    const {time, playing} = this, {start, speed, loop} = clip, kept = keep && this.loaded;
    Object.assign(this, {tracks: new Map(), bands: new Map(), start, end: start, loaded: true});
    if (!kept) Object.assign(this, {speed, loop, time: start, playing: false});
    this.extend(clip);
    if (kept) this.seek(time);
    if (kept ? playing : clip.play) this.play();
  }

  extend(clip) {
    for (const {path, property, clock, values} of clip.tracks) {
      const key = `${path}\n${property}`;
      if (!this.tracks.has(key)) this.tracks.set(key, new Track(path, property));
      this.tracks.get(key).append(clip.clocks[clock], values);
    }
    for (const band of clip.bands) this._mark(band);
    this.refresh();
    this.set({end: clip.end, horizon: clip.horizon, open: clip.open});
  }

  play() {
    if (!this.loaded || this.playing) return;
    if (this.time >= this.end && !this.open) this.seek(this.start);
    this.set({playing: true});
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

  pause() { if (this.playing) this.set({playing: false}); }
  toggle() { if (this.playing) this.pause(); else this.play(); }

  // Show a time [s], limited to the clip.
  seek(time) {
    this.time = clamp(time, this.start, this.end);
    this.refresh();
    this._emit("time", {time: this.time});
  }

  halt(time) {
    this.pause();
    this.seek(time);
  }

  step(seconds) { this.halt(this.time + seconds); }

  faster() { this.set({speed: Player.SPEEDS.find((x) => x > this.speed) ?? this.speed}); }
  slower() { this.set({speed: Player.SPEEDS.findLast((x) => x < this.speed) ?? this.speed}); }

  pose(tracks) {
    for (const {path, property, values} of tracks) {
      new Track(path, property).append([0], values).show(this.viewer, 0);
    }
    this.viewer.set_dirty();
  }

  refresh() {
    for (const track of this.tracks.values()) track.show(this.viewer, this.time);
    this.viewer.set_dirty();
  }

  _advance(seconds) {
    const {start, end} = this;
    let next = this.time + seconds * this.speed;
    if (this.open) {
      // A run that is computed slower than real time: follow its end smoothly.
      const behind = Math.max(end - this.time, 0);
      next = Math.min(next, this.time + behind * Math.min(1, seconds / 0.3));
    } else if (next >= end && this.loop && end > start) {
      next = start + (next - end) % (end - start);
    }
    this.seek(next);
    if (!this.open && next >= end) this.pause();
  }

  // Add a band; one that begins where the last interval of its name ended continues that.
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

function findNode(viewer, path) {  // none is created
  return elements(path).reduce((node, name) => node?.children[name], viewer.scene_tree);
}

function elements(path) { return path.split("/").filter(Boolean); }

// The animation of a property of a node, in pieces: each begins at the last row of the one before.
class Track {
  constructor(path, property) {
    const interpolant = Track.INTERPOLANTS[property] ?? "LinearInterpolant";
    Object.assign(this, {path, interpolant, pieces: [], apply: Track.PROPERTIES[property]});
  }

  append(times, values) {
    const width = values.length / times.length;
    this.pieces.push(new MeshCat.THREE[this.interpolant](times, values, width));
    return this;
  }

  show(viewer, time) {
    const node = findNode(viewer, this.path);
    if (!node) return;
    const begun = ({parameterPositions}) => parameterPositions[0] <= time;
    const piece = this.pieces.findLast(begun) ?? this.pieces[0];
    this.apply(node, piece.evaluate(time));
  }

  static INTERPOLANTS = {quaternion: "QuaternionLinearInterpolant", visible: "DiscreteInterpolant"};

  static PROPERTIES = {
    position({object}, place) { object.position.fromArray(place); },
    quaternion({object}, turn) { object.quaternion.fromArray(turn); },
    // A scale of 0 is not invertible.
    scale({object}, scale) { object.scale.fromArray(scale.map((x) => x || 1e-9)); },
    // Acts on the node's object, so that the node's switch in the legend remains the user's.
    visible({children}, [seen]) {
      const thing = children["<object>"];
      if (thing) thing.object.visible = seen > 0.5;
    },
    color({object}, color) {
      eachMaterial(object, (material) => material.color?.fromArray(color));
    },
    // The number of drawn rings of a trail after its first: see things.js.
    length({object}, [rings]) { drawRings(object, rings); },
  };
}

function eachMaterial(object, use) {
  object.traverse(({material}) => {
    if (material) [material].flat(Infinity).forEach(use);
  });
}
