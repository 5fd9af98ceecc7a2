// A path in space as a thin tube, because WebGL's lines are one pixel wide.
//
// Ring i surrounds point i, and `userData.segment` is the number of indices from one ring to
// the next, so that a part of the path can be drawn: see "length" in player.js.
"use strict";

function trailGeometry(points, radius, sides = 8) {
  const {BufferGeometry, BufferAttribute, Vector3} = MeshCat.THREE;
  const count = points.length / 3;
  const positions = new Float32Array(3 * sides * count);
  const normals = new Float32Array(3 * sides * count);
  const point = (i) => new Vector3().fromArray(points, 3 * Math.min(Math.max(i, 0), count - 1));
  const axisAcross = ({x, y, z}) => {
    const [a, b, c] = [x, y, z].map(Math.abs);
    return new Vector3(+(a <= b && a <= c), +(b < a && b <= c), +(c < a && c < b));
  };
  // Two unit vectors normal to the path, transported along it with little twist.
  let tangent = null, normal = null;
  for (let i = 0; i < count && !tangent; i++) tangent = direction(i);
  tangent ??= new Vector3(1, 0, 0);
  function direction(i) {
    const step = point(i + 1).sub(point(i - 1));
    return step.length() > 1e-9 ? step.normalize() : null;
  }
  for (let i = 0; i < count; i++) {
    tangent = direction(i) ?? tangent;
    normal?.addScaledVector(tangent, -normal.dot(tangent));
    if (!normal || normal.length() < 1e-6) normal = tangent.clone().cross(axisAcross(tangent));
    normal.normalize();
    const binormal = tangent.clone().cross(normal);
    const center = point(i);
    for (let side = 0; side < sides; side++) {
      const angle = 2 * Math.PI * side / sides, at = 3 * (i * sides + side);
      const outward = normal.clone().multiplyScalar(Math.cos(angle))
        .addScaledVector(binormal, Math.sin(angle));
      outward.toArray(normals, at);
      outward.multiplyScalar(radius).add(center).toArray(positions, at);
    }
  }
  const segment = 6 * sides;
  const index = new Uint32Array(segment * Math.max(0, count - 1));
  let k = 0;
  for (let i = 0; i + 1 < count; i++) {
    for (let side = 0; side < sides; side++) {
      const here = i * sides + side, there = i * sides + (side + 1) % sides;
      for (const v of [here, there, here + sides, there, there + sides, here + sides]) {
        index[k++] = v;
      }
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  geometry.setAttribute("normal", new BufferAttribute(normals, 3));
  geometry.setIndex(new BufferAttribute(index, 1));
  geometry.userData = {segment, points};
  return geometry;
}

// A trail in one colour, the same in any light. Of a sleeve only the back faces are drawn,
// so that it never hides its content.
function trailMesh({points, radius, color, sleeve}) {
  const {Mesh, MeshBasicMaterial, BackSide, FrontSide} = MeshCat.THREE;
  const material = new MeshBasicMaterial({color, side: sleeve ? BackSide : FrontSide});
  const mesh = new Mesh(trailGeometry(points, radius), material);
  mesh.userData = {radius};
  mesh.frustumCulled = false;  // it grows
  return mesh;
}

// Append points to a trail.
function extendTrail(object, more) {
  object.traverse((mesh) => {
    const {points} = mesh.geometry?.userData ?? {};
    if (!points) return;
    const all = new Float32Array(points.length + more.length);
    all.set(points);
    all.set(more, points.length);
    mesh.geometry.dispose();
    mesh.geometry = trailGeometry(all, mesh.userData.radius);
  });
}

// Draw only the given number of rings after the first.
function drawLength(object, rings) {
  object.traverse(({geometry}) => {
    const size = geometry?.userData.segment;
    if (size) geometry.setDrawRange(0, size * Math.floor(rings + 1e-6));
  });
}
