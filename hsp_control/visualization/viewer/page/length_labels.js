// Labels beside bars, with their lengths: they follow the bars as the scene moves.
//
//   const lengthLabels = new LengthLabels(viewer);
//   lengthLabels.add("/distances/clearance ball/bar");   // a node with a bar of length 1 along z
//   lengthLabels.update();                               // after each drawing
//
// A bar's length is its node's scale in z [m], which the player or the program sets.
"use strict";

class LengthLabels {
  static MOST = 8;  // more would hide the scene: then the shortest bars have labels
  static GAP = 7;  // between a bar and its label [px]

  constructor(viewer) {
    this.viewer = viewer;
    this.paths = new Set();
    this.labels = [];
  }

  add(path) { this.paths.add(path); }

  update() {
    const bars = this.bars();
    while (this.labels.length < bars.length) {
      const label = document.createElement("div");
      label.className = "length-label";
      this.viewer.dom_element.append(label);
      this.labels.push(label);
    }
    this.labels.forEach((label, k) => {
      label.hidden = k >= bars.length;
      if (label.hidden) return;
      const text = `${bars[k].length.toFixed(2)} m`;
      if (label.textContent !== text) label.textContent = text;
      this.place(label, bars[k].bar);
    });
  }

  // The visible bars, the shortest first, with their lengths.
  bars() {
    const bars = [];
    for (const path of this.paths) {
      let node = this.viewer.scene_tree;
      let seen = true;
      for (const name of path.split("/").filter(Boolean)) {
        node = node?.children[name];
        seen &&= node?.object.visible;
      }
      const drawn = node?.children["<object>"]?.object;
      if (!drawn) this.paths.delete(path);  // the node was deleted
      else if (seen && drawn.visible && drawn.layers.test(this.viewer.camera.layers)) {
        bars.push({bar: node.object, length: node.object.scale.z});
      }
    }
    return bars.sort((one, other) => one.length - other.length).slice(0, LengthLabels.MOST);
  }

  // Put a label beside the middle of a bar, so that it does not cover the bar.
  place(label, bar) {
    const {clientWidth, clientHeight} = this.viewer.dom_element;
    const seen = (z) => {
      const point = new MeshCat.THREE.Vector3(0, 0, z).applyMatrix4(bar.matrixWorld);
      point.project(this.viewer.camera);
      return [(point.x + 1) / 2 * clientWidth, (1 - point.y) / 2 * clientHeight, point.z];
    };
    const [x0, y0] = seen(0), [x1, y1] = seen(1), [x, y, depth] = seen(0.5);
    if (Math.abs(depth) > 1) label.hidden = true;  // behind the camera
    const length = Math.hypot(x1 - x0, y1 - y0) || 1;
    // Normal to the bar, and to the right, or up if the bar is level.
    let across = [(y0 - y1) / length, (x1 - x0) / length];
    if (across[0] < -1e-3 || (across[0] < 1e-3 && across[1] > 0)) across = across.map((c) => -c);
    const {offsetWidth, offsetHeight} = label;
    const away = LengthLabels.GAP + Math.abs(across[0]) * offsetWidth / 2
      + Math.abs(across[1]) * offsetHeight / 2;
    const left = x + away * across[0] - offsetWidth / 2;
    const top = y + away * across[1] - offsetHeight / 2;
    // Whole pixels: else the same time may give another image.
    label.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
  }
}
