// The player: moves the scene along a clip, and tells everybody the time.
//
// The one player of all our pages. It knows neither a server nor a file: give it a scene
// tree and a clip, wherever they come from. The live page gets its clip over the
// websocket, the exported page holds it; what follows is the same for both.
//
//   const player = new Player(viewer);        // a MeshCat.Viewer
//   new Controls(player, document.body);      // controls.js: the bar and the keyboard
//   player.load(clip);                        // shows the clip's start; plays if it says so
//   player.seek(2.5);                         // shows t = 2.5 s, exactly and at once
//   player.addEventListener("time", ({detail}) => cursor.moveTo(detail.time));
//
// A clip, as hsp_control/viewer/clip.py writes it:
//
//   start, end   [s]    first and last time that can be shown
//   horizon      [s]    where the clip will end once it is whole; the same as `end` then
//   open                whether more of it is to come (a run that is still computed)
//   play, loop, speed   how to begin: playing or at rest, once or again and again
//   clocks              arrays of times [s], ascending
//   tracks              [{path, property, clock, values}]: what a node of the scene does;
//                       `clock` is the index of its times, `values` are all rows in one
//                       Float32Array. Before its first time and after its last one, a
//                       track keeps its first and its last value.
//
// Properties: "position" (3), "quaternion" (x, y, z, w), "scale" (3), "color" (red, green,
// blue from 0 to 1), "opacity" (1), "length" (1: the rings of a trail, see trail.js, that
// are drawn after its first), all interpolated, the quaternion on its sphere; and "visible" (1: 0 or 1), which jumps, and
// leaves the node's own switch in the scene tree to the user. A path that is not in the
// scene is passed over: what is left out of the scene need not be left out of the clip.
//
// Attributes (read): time, start, end, horizon, open, playing, speed, loop, loaded.
// Methods: load(clip), extend(clip), unload(), play(), pause(), toggle(), seek(t),
// step(dt), faster(), slower(), setSpeed(x), setLoop(on), refresh().
// Events: "time" (detail: {time, start, end}) whenever another time is shown; "state"
// whenever playing, speed, loop, or what can be played has changed.
"use strict";

class Player extends EventTarget {
  static SPEEDS = [0.05, 0.1, 0.25, 0.5, 1, 2, 4, 8];

  constructor(viewer) {
    super();
    this.viewer = viewer;
    this.speed = 1;
    this.loop = false;
    this.unload();
  }

  // Forget the clip; the scene stays as it is.
  unload() {
    this.tracks = new Map();
    this.time = this.start = this.end = this.horizon = 0;
    this.open = this.playing = this.loaded = false;
    this._said("state");
  }

  // Show a clip in place of the last one. With `keep`, at the same time and as before.
  load(clip, keep = false) {
    const {time, playing, loaded} = this;
    this.tracks = new Map();
    this.start = this.end = clip.start;
    if (!(keep && loaded)) {
      this.speed = clip.speed ?? this.speed;
      this.loop = clip.loop ?? this.loop;
      this.time = clip.start;
      this.playing = false;
    }
    this.loaded = true;
    this.extend(clip);
    if (keep && loaded) this.seek(time);
    if (keep && loaded ? playing : clip.play) this.play();
  }

  // Add what comes after the clip's end.
  extend(clip) {
    const copies = clip.clocks.map((clock) => Float64Array.from(clock));
    for (const {path, property, clock, values} of clip.tracks) {
      const key = `${path}\n${property}`;
      const track = this.tracks.get(key);
      if (track) track.append(copies[clock], values);
      else this.tracks.set(key, new Track(path, property, copies[clock], values));
    }
    this.end = Math.max(this.end, clip.end);
    this.horizon = Math.max(this.end, clip.horizon ?? clip.end);
    this.open = Boolean(clip.open);
    this.refresh();
    this._said("state");
  }

  play() {
    if (!this.loaded || this.playing) return;
    if (this.time >= this.end && !this.open) this.seek(this.start);
    this.playing = true;
    this._said("state");
    let last = performance.now();
    const frame = (now) => {
      if (this._frame !== frame || !this.playing) return;
      // A page that was out of sight goes on where it was.
      this._advance(Math.min(Math.max(now - last, 0) / 1000, 0.25));
      last = now;
      if (this.playing) requestAnimationFrame(frame);
    };
    this._frame = frame;
    requestAnimationFrame(frame);
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this._said("state");
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  // Show a time [s], within what there is.
  seek(time) {
    this.time = Math.min(Math.max(time, this.start), this.end);
    this.refresh();
    const {start, end} = this;
    this._said("time", {time: this.time, start, end});
  }

  // Rest, and go on or back by some seconds.
  step(seconds) {
    this.pause();
    this.seek(this.time + seconds);
  }

  setSpeed(speed) {
    this.speed = speed;
    this._said("state");
  }

  faster() { this.setSpeed(Player.SPEEDS.find((x) => x > this.speed) ?? this.speed); }

  slower() { this.setSpeed(Player.SPEEDS.findLast((x) => x < this.speed) ?? this.speed); }

  setLoop(on) {
    this.loop = on;
    this._said("state");
  }

  // Show the present time again, after the scene has changed.
  refresh() {
    for (const track of this.tracks.values()) {
      const node = this._node(track.path);
      if (node) track.apply(node, this.time);
    }
    this.viewer.set_dirty();
  }

  _advance(seconds) {
    let next = this.time + seconds * this.speed;
    if (this.open) {
      // Behind a run that is slower than its clock: follow its end smoothly.
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
    if (!this.playing) this._said("state");
  }

  _node(path) {
    let node = this.viewer.scene_tree;
    for (const name of path.split("/")) {
      if (name && node) node = node.children[name];
    }
    return node;
  }

  _said(kind, detail = {}) { this.dispatchEvent(new CustomEvent(kind, {detail})); }
}

// What one property of one node does in time.
class Track {
  constructor(path, property, times, values) {
    Object.assign(this, {path, property, times, values, count: times.length});
    this.width = times.length ? values.length / times.length : 1;
    this.apply = Track.PROPERTIES[property] ?? (() => {});
    this._at = 0;
    this._value = new Array(this.width).fill(0);
  }

  append(times, values) {
    this.times = grown(this.times, this.count, times);
    this.values = grown(this.values, this.count * this.width, values);
    this.count += times.length;
  }

  // The row before a time and how far it is to the next one.
  moment(time) {
    const {times, count} = this;
    let low = this._at, high = count - 1;
    if (!(times[low] <= time)) low = 0;
    else if (low + 2 < count && time < times[low + 2]) high = Math.min(high, low + 2);
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle; else high = middle;
    }
    this._at = low;
    const fraction = high > low ? (time - times[low]) / (times[high] - times[low]) : 0;
    return [low, high, Math.min(Math.max(fraction, 0), 1)];
  }

  linear(time) {
    const [low, high, fraction] = this.moment(time);
    const {values, width, _value} = this;
    for (let k = 0; k < width; k++) {
      const here = values[low * width + k];
      _value[k] = here + fraction * (values[high * width + k] - here);
    }
    return _value;
  }

  spherical(time) {
    const [low, high, fraction] = this.moment(time);
    MeshCat.THREE.Quaternion.slerpFlat(
      this._value, 0, this.values, 4 * low, this.values, 4 * high, fraction);
    return this._value;
  }

  stepped(time) {
    const [low, high, fraction] = this.moment(time);
    return this.values[(fraction >= 1 ? high : low) * this.width];
  }

  static PROPERTIES = {
    position({object}, time) { object.position.fromArray(this.linear(time)); },
    quaternion({object}, time) { object.quaternion.fromArray(this.spherical(time)); },
    scale({object}, time) {
      const scale = this.linear(time);
      object.scale.fromArray(scale.map((x) => x || 1e-9));  // 0 has no inverse
    },
    visible({children}, time) {
      const thing = children["<object>"];
      if (thing) thing.object.visible = this.stepped(time) > 0.5;
    },
    color({object}, time) {
      const value = this.linear(time);
      eachMaterial(object, (material) => material.color?.fromArray(value));
    },
    opacity({object}, time) {
      const [opacity] = this.linear(time);
      eachMaterial(object, (material) => {
        material.opacity = opacity;
        material.transparent = opacity < 1;
      });
    },
    length({object}, time) { drawLength(object, this.linear(time)[0]); },
  };
}

function eachMaterial(object, use) {
  object.traverse(({material}) => {
    if (material) [material].flat(Infinity).forEach(use);
  });
}

// An array with more behind its first `count` numbers, in room that doubles.
function grown(array, count, more) {
  let room = array;
  if (count + more.length > array.length) {
    room = new array.constructor(Math.max(2 * array.length, count + more.length));
    room.set(array.subarray(0, count));
  }
  room.set(more, count);
  return room;
}
