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
  static BESIDE = 12;  // px from a bar's middle

  constructor(viewer) {
    this.viewer = viewer;
    this.paths = new Set();
    this.labels = [];
    viewer.dom_element.style.position ||= "relative";
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
      else if (seen && drawn.visible) bars.push({bar: node.object, length: node.object.scale.z});
    }
    return bars.sort((one, other) => one.length - other.length).slice(0, LengthLabels.MOST);
  }

  // Put a label beside the middle of a bar, on the side to which the bar does not run.
  place(label, bar) {
    const {clientWidth, clientHeight} = this.viewer.dom_element;
    const seen = (z) => {
      const point = new MeshCat.THREE.Vector3(0, 0, z).applyMatrix4(bar.matrixWorld);
      point.project(this.viewer.camera);
      return [(point.x + 1) / 2 * clientWidth, (1 - point.y) / 2 * clientHeight, point.z];
    };
    const [x, y, depth] = seen(0.5);
    const [x0, y0] = seen(0), [x1, y1] = seen(1);
    if (Math.abs(depth) > 1) label.hidden = true;  // behind the camera
    // Beside a steep bar, above a level one.
    const steep = Math.abs(y1 - y0) > Math.abs(x1 - x0);
    const shift = steep ? `${x + LengthLabels.BESIDE}px, calc(${y}px - 50%)`
      : `calc(${x}px - 50%), calc(${y - LengthLabels.BESIDE}px - 100%)`;
    label.style.transform = `translate(${shift})`;
  }
}
