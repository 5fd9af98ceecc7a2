// Signed distances of a point to solids about their own origin, and how the normal turns.
#pragma once
#include <cmath>
#include <hsp/view.hpp>

namespace hsp {

enum BodyKind { SEGMENT, BOX, CYLINDER, HALF_SPACE };  // as in closed_form.py

// Below this distance two points, or a point and an axis, define no direction [m].
constexpr double coincident = 1e-12;

// In the solid's axes. The normal n is the gradient of the distance, a unit vector; it turns with
// the point's velocity there, n' = H x', where H is the distance's Hessian.
struct SolidDistance {
  double distance;  // [m], negative inside
  Vector3 normal, normal_dot;
};

inline double signum(double x) { return x > 0.0 ? 1.0 : -1.0; }

// |x| - size is how far the point is beyond each pair of faces; inside, the nearest face is used.
// Outside, H = (I - n nᵀ)/d in the coordinates in which it is beyond.
inline SolidDistance distance_to_box(const Vector3& half_edges, const Vector3& x,
                                     const Vector3& x_dot) {
  const Vector3 side(signum(x[0]), signum(x[1]), signum(x[2]));
  const Vector3 beyond = x.cwiseAbs() - half_edges;
  Index nearest;
  const double largest = beyond.maxCoeff(&nearest);
  if (largest <= 0.0) return {largest, side[nearest] * Vector3::Unit(nearest), Vector3::Zero()};
  const Vector3 away = side.cwiseProduct(beyond.cwiseMax(0.0));
  const double distance = away.norm();
  const Vector3 n = away / distance;
  const Vector3 moving = (beyond.array() > 0.0).select(x_dot, 0.0);
  return {distance, n, (moving - n.dot(x_dot) * n) / distance};
}

// Along z. The nearest point is on the side, on an end, or on the edge between them. A radial
// normal turns about the axis by 1/r, and one from the edge also about the edge, by 1/d.
inline SolidDistance distance_to_cylinder(double radius, double half, const Vector3& x,
                                          const Vector3& x_dot) {
  const double r = x.head<2>().norm();
  // On the axis any direction is radial, and none turns: there 1/r would be infinite.
  const bool on_axis = r < coincident;
  const Vector3 radial = on_axis ? Vector3(1.0, 0.0, 0.0) : Vector3(x[0] / r, x[1] / r, 0.0);
  const Vector3 axial(0.0, 0.0, signum(x[2])), around(-radial[1], radial[0], 0.0);
  const Vector3 radial_dot = on_axis ? Vector3(0.0, 0.0, 0.0) : around.dot(x_dot) / r * around;
  const double side = r - radius, end = std::abs(x[2]) - half;
  if (side > 0.0 && end > 0.0) {
    const double distance = std::sqrt(side * side + end * end);
    const double out = side / distance, along = end / distance;
    const Vector3 across = along * radial - out * axial;
    return {distance, out * radial + along * axial,
            across.dot(x_dot) / distance * across + out * radial_dot};
  }
  if (side > end) return {side, radial, radial_dot};
  return {end, axial, Vector3::Zero()};
}

// The size is a box's half edges; a cylinder's radius, radius and half height [m]. A half-space is
// below z = 0.
inline SolidDistance distance_to_solid(std::int64_t kind, const Vector3& size, const Vector3& x,
                                       const Vector3& x_dot) {
  if (kind == BOX) return distance_to_box(size, x, x_dot);
  if (kind == CYLINDER) return distance_to_cylinder(size[0], size[2], x, x_dot);
  return {x[2], Vector3::UnitZ(), Vector3::Zero()};
}

}  // namespace hsp
