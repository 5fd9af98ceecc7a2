// How a pointer moves things: in a plane, along a line, or about an axis.
//
// Each function takes the pixel at which a thing is grabbed and returns a function from
// later pixels to its new place or angle; null where the pointer tells none, such as at
// the horizon of the plane. The thing keeps its offset from the pointer: it never jumps.
"use strict";

const Drags = {
  REACH: 20,  // m: no drag leads farther from the eye

  // A point's places in the plane through it.
  plane(sight, from, normal, x, y) {
    const start = Drags.hit(sight, from, normal, x, y) ?? from.clone();
    const offset = from.clone().sub(start);
    return (x, y) => Drags.hit(sight, from, normal, x, y)?.add(offset) ?? null;
  },

  // The point of a plane under a pixel.
  hit(sight, through, normal, x, y) {
    const {origin, direction} = sight.ray(x, y);
    const along = direction.dot(normal);
    if (Math.abs(along) < 0.02) return null;
    const reach = through.clone().sub(origin).dot(normal) / along;
    if (!(reach > 0 && reach < Drags.REACH + sight.depth(through))) return null;
    return origin.addScaledVector(direction, reach);
  },

  // A point's places on the line through it.
  line(sight, from, axis, x, y) {
    const nearest = (x, y) => {
      const {origin, direction} = sight.ray(x, y);
      const between = from.clone().sub(origin);
      const cosine = axis.dot(direction);
      if (1 - cosine * cosine < 0.01) return null;
      return (cosine * direction.dot(between) - axis.dot(between)) / (1 - cosine * cosine);
    };
    const start = nearest(x, y) ?? 0;
    return (x, y) => {
      const way = nearest(x, y);
      if (way === null || Math.abs(way - start) > Drags.REACH) return null;
      return from.clone().addScaledVector(axis, way - start);
    };
  },

  // Angles about an axis [rad]; more than a turn is counted on.
  turn(sight, center, axis, radius, x, y) {
    const facing = sight.towards(center).dot(axis);
    if (Math.abs(facing) < 0.2) {  // seen from its edge: the ring's near side is moved
      const along = sight.towards(center).cross(axis).negate().normalize();
      const here = sight.project(center);
      const there = sight.project(center.clone().addScaledVector(along, sight.pixel(center)));
      const [dx, dy] = [there.x - here.x, there.y - here.y];
      const length = Math.hypot(dx, dy) || 1;
      return (to_x, to_y) => ((to_x - x) * dx + (to_y - y) * dy) / length / radius;
    }
    const spoke = (x, y) => Drags.hit(sight, center, axis, x, y)?.sub(center);
    let last = spoke(x, y), total = 0;
    return (x, y) => {
      const next = spoke(x, y);
      if (!next) return null;
      if (last) total += Math.atan2(last.clone().cross(next).dot(axis), last.dot(next));
      last = next;
      return total;
    };
  },
};
