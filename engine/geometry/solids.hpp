// Signed distances of a point to solids about their own origin, with gradient and Hessian.
#pragma once
#include <cmath>
#include <hsp/view.hpp>

namespace hsp {

enum BodyKind { SEGMENT, BOX, CYLINDER, HALF_SPACE };  // as in closed_form.py

// Below this distance two points, or a point and an axis, define no direction [m].
constexpr double coincident = 1e-12;

struct SolidDistance {
  double distance;  // [m], negative inside
  Vector3 normal;   // its gradient, a unit vector
  Matrix3 hessian;  // [1/m]
};

inline double signum(double x) { return x > 0.0 ? 1.0 : -1.0; }

// |x| - size is how far the point is beyond each pair of faces; inside, the nearest face counts.
inline SolidDistance distance_to_box(const Vector3& half_edges, const Vector3& x) {
  const Vector3 side = x.unaryExpr(&signum), beyond = x.cwiseAbs() - half_edges;
  Index nearest;
  const double largest = beyond.maxCoeff(&nearest);
  if (largest <= 0.0) return {largest, side[nearest] * Vector3::Unit(nearest), Matrix3::Zero()};
  const Vector3 away = side.cwiseProduct(beyond.cwiseMax(0.0));
  const double distance = away.norm();
  const Vector3 n = away / distance;
  const Vector3 outside = (beyond.array() > 0.0).cast<double>();
  return {distance, n, (Matrix3(outside.asDiagonal()) - n * n.transpose()) / distance};
}

// Along z. The nearest point is on the side, on an end, or on the edge between them, about which
// the normal turns.
inline SolidDistance distance_to_cylinder(double radius, double half, const Vector3& x) {
  const double r = x.head<2>().norm();
  // On the axis any direction is radial, and none turns: there 1/r would be infinite.
  const bool on_axis = r < coincident;
  const Vector3 radial = on_axis ? Vector3(1.0, 0.0, 0.0) : Vector3(x[0] / r, x[1] / r, 0.0);
  const Vector3 axial(0.0, 0.0, signum(x[2])), around(-radial[1], radial[0], 0.0);
  const double curvature = on_axis ? 0.0 : 1.0 / r;
  const double side = r - radius, end = std::abs(x[2]) - half;
  if (side > 0.0 && end > 0.0) {
    const double distance = std::sqrt(side * side + end * end);
    const double out = side / distance, along = end / distance;
    const Vector3 across = along * radial - out * axial;
    return {distance, out * radial + along * axial,
            across * across.transpose() / distance + out * curvature * around * around.transpose()};
  }
  if (side > end) return {side, radial, curvature * around * around.transpose()};
  return {end, axial, Matrix3::Zero()};
}

// In the solid's axes. The size is a box's half edges; a cylinder's radius, radius and half
// height [m]. A half-space is below z = 0.
inline SolidDistance distance_to_solid(std::int64_t kind, const Vector3& size, const Vector3& x) {
  if (kind == BOX) return distance_to_box(size, x);
  if (kind == CYLINDER) return distance_to_cylinder(size[0], size[2], x);
  return {x[2], Vector3::UnitZ(), Matrix3::Zero()};
}

}  // namespace hsp
