// The nearest points of two cores: segments, or a point and a solid.
#pragma once
#include <cmath>

#include "bodies.hpp"
#include "solids.hpp"

namespace hsp {

// The nearest points of two cores, and the unit vector from the second to the first.
struct Nearest {
  double distance;
  Vector3 x, y, n;
};

struct MovingNearest : Nearest {
  Vector3 x_dot, y_dot, n_dot;
};

// n is the z axis if the points coincide, so that all results are finite.
inline Nearest between_points(const Vector3& x, const Vector3& y) {
  const double distance = (x - y).norm();
  if (distance < coincident) return {0.0, x, y, Vector3::UnitZ()};
  return {distance, x, y, (x - y) / distance};
}

inline Nearest between_segments(const Segment& first, const Segment& second) {
  const OnSegments at = nearest_on_segments(first, second);
  return between_points(first.start + at.s * first.axis, second.start + at.t * second.axis);
}

// n' = (x' - y' - d' n)/d
inline MovingNearest between_segments(const MovingSegment& first, const MovingSegment& second) {
  const OnSegments at = nearest_on_segments(first, second);
  const auto [s_dot, t_dot] = nearest_rates(first, second, at);
  const Nearest now =
      between_points(first.start + at.s * first.axis, second.start + at.t * second.axis);
  const Vector3 x_dot = first.start_dot + at.s * first.axis_dot + s_dot * first.axis;
  const Vector3 y_dot = second.start_dot + at.t * second.axis_dot + t_dot * second.axis;
  const Vector3 apart = x_dot - y_dot;
  if (now.distance == 0.0) return {now, x_dot, y_dot, Vector3::Zero()};
  return {now, x_dot, y_dot, (apart - now.n.dot(apart) * now.n) / now.distance};
}

// From a sphere's centre to a solid, which moves with a twist. In the solid's axes the normal is
// the gradient of the distance at x, so that n' = ω × n + R H Rᵀ(x' - y'), where y' is the velocity
// of the solid's point at x.
inline MovingNearest to_solid(const Bodies& bodies, Index i, const Twist& twist, const Vector3& x,
                              const Vector3& x_dot) {
  const auto [R, p] = placement_of_obstacle(bodies, i);
  const Vector3 y_dot = twist.at(x);
  const auto [distance, normal, turning] = distance_to_solid(
      bodies.kind(i), bodies.size(i), R.transpose() * (x - p), R.transpose() * (x_dot - y_dot));
  const Vector3 n = R * normal, n_dot = twist.angular.cross(n) + R * turning;
  return {{distance, x, x - distance * n, n}, x_dot, y_dot, n_dot};
}

inline Nearest to_solid(const Bodies& bodies, Index i, const Vector3& x) {
  const auto [R, p] = placement_of_obstacle(bodies, i);
  const auto [distance, normal, _] =
      distance_to_solid(bodies.kind(i), bodies.size(i), R.transpose() * (x - p), Vector3::Zero());
  const Vector3 n = R * normal;
  return {distance, x, x - distance * n, n};
}

}  // namespace hsp
