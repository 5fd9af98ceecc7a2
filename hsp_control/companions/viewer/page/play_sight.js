// The camera's view, and how a pointer moves things in it. Points and directions are in Pinocchio's
// axes (z up), which are those inside Meshcat's scene; pixels are those of pointer events.

class Sight {
  static REACH = 20;  // m: no drag leads farther from the eye
  static NEAR = 0.08;  // of the picture's height: a point nearer to the robot is at the robot

  constructor(viewer) { this.viewer = viewer; }

  // Read the camera's present pose; call it before a series of queries.
  update() {
    const {camera, scene, renderer} = this.viewer, {Vector3} = MeshCat.THREE;
    camera.updateWorldMatrix(true, false);
    this.box = renderer.domElement.getBoundingClientRect();
    this.toScene = scene.matrixWorld.clone().invert();
    const pose = this.toScene.clone().multiply(camera.matrixWorld);
    [this.right, this.up, this.back, this.eye] = [0, 1, 2, 3].map((column) =>
      new Vector3().setFromMatrixColumn(pose, column));
    return this;
  }

  // A point's pixel, and whether it lies in front of the camera.
  project(point) {
    const {camera, scene} = this.viewer, {left, top} = this.box;
    const {x, y} = pixelOf(this.viewer, point.clone().applyMatrix4(scene.matrixWorld));
    return {x: left + x, y: top + y, ahead: this.depth(point) > camera.near};
  }

  depth(point) { return this.eye.clone().sub(point).dot(this.back); }

  // The length at a point that covers one pixel [m].
  pixel(point) {
    const {fov} = this.viewer.camera;
    return Math.max(this.depth(point), 1e-6) * 2 * Math.tan(fov * Math.PI / 360) / this.box.height;
  }

  towards(point) { return this.eye.clone().sub(point).normalize(); }

  // A raycaster through a pixel, in three.js's own axes; and its ray in ours.
  caster(x, y) {
    const {left, top, width, height} = this.box, caster = new MeshCat.THREE.Raycaster();
    const place = {x: 2 * (x - left) / width - 1, y: 1 - 2 * (y - top) / height};
    caster.setFromCamera(place, this.viewer.camera);
    return caster;
  }

  ray(x, y) { return this.caster(x, y).ray.applyMatrix4(this.toScene); }

  // The point of a plane under a pixel; null at its horizon.
  hit(through, normal, x, y) {
    const {origin, direction} = this.ray(x, y), along = direction.dot(normal);
    const reach = through.clone().sub(origin).dot(normal) / along;
    const near = reach > 0 && reach < Sight.REACH + this.depth(through);
    return Math.abs(along) > 0.02 && near ? origin.addScaledVector(direction, reach) : null;
  }

  // The next four take the pixel at which a thing is grabbed, and return a function from later
  // pixels to its new place or angle; null where the pointer determines none. The thing keeps its
  // offset from the pointer: it never jumps.

  // A point's places in the plane through it.
  inPlane(from, normal, x, y) {
    const offset = from.clone().sub(this.hit(from, normal, x, y) ?? from);
    return (x, y) => this.hit(from, normal, x, y)?.add(offset) ?? null;
  }

  // A point's places at the robot's depth where it is near the robot in the picture, and at
  // the point's own depth elsewhere. A start that is elsewhere at the robot comes there on the way.
  atRobot(from, robot, x, y) {
    const start = this.project(from), own = this.depth(from), near = Sight.NEAR * this.box.height;
    const closeness = (dx, dy) => Math.exp(-(dx * dx + dy * dy) / near ** 2);
    const depthAt = (x, y) => {
      let closest = 0, total = 1e-200, sum = 0;
      for (const point of this.surface(robot)) {
        const seen = this.project(point), share = closeness(seen.x - x, seen.y - y);
        closest = Math.max(closest, share);
        total += share;
        sum += share * this.depth(point);
      }
      return own + closest * (sum / total - own);
    };
    const missing = own - depthAt(start.x, start.y);
    return (to_x, to_y) => {
      const [px, py] = [start.x + to_x - x, start.y + to_y - y];
      const depth = depthAt(px, py) + missing * closeness(px - start.x, py - start.y);
      const {origin, direction} = this.ray(px, py);
      return origin.addScaledVector(direction, Math.max(depth, 0.1) / -direction.dot(this.back));
    };
  }

  surface(robot) {
    const points = [];
    robot?.traverse(({geometry, matrixWorld}) => {
      const {position} = geometry?.attributes ?? {};
      for (let k = 0; k < (position?.count ?? 0); k += Math.ceil(position.count / 50)) {
        points.push(new MeshCat.THREE.Vector3().fromBufferAttribute(position, k)
          .applyMatrix4(matrixWorld).applyMatrix4(this.toScene));
      }
    });
    return points;
  }

  // A point's places on the line through it.
  onLine(from, axis, x, y) {
    const nearest = (x, y) => {
      const {origin, direction} = this.ray(x, y), between = from.clone().sub(origin);
      const cosine = axis.dot(direction), sine2 = 1 - cosine * cosine;
      return sine2 < 0.01 ? NaN : (cosine * direction.dot(between) - axis.dot(between)) / sine2;
    };
    const start = nearest(x, y) || 0;
    return (x, y) => {
      const way = nearest(x, y) - start;
      return Math.abs(way) < Sight.REACH ? from.clone().addScaledVector(axis, way) : null;
    };
  }

  // Angles about an axis [rad]; they continue beyond one turn. The radius is in pixels.
  about(center, axis, radius, x, y) {
    const eye = this.towards(center);
    if (Math.abs(eye.dot(axis)) < 0.2) {  // from its edge: its near side is moved
      const along = eye.cross(axis).negate().setLength(this.pixel(center));
      const here = this.project(center), there = this.project(center.clone().add(along));
      const [dx, dy] = [there.x - here.x, there.y - here.y], length = Math.hypot(dx, dy) || 1;
      return (to_x, to_y) => ((to_x - x) * dx + (to_y - y) * dy) / length / radius;
    }
    const spoke = (x, y) => this.hit(center, axis, x, y)?.sub(center);
    let last = spoke(x, y), total = 0;
    return (x, y) => {
      const next = spoke(x, y);
      if (!next) return null;
      if (last) total += Math.atan2(last.clone().cross(next).dot(axis), last.dot(next));
      last = next;
      return total;
    };
  }
}
