// Distances in closed form, with the exact rate of their gradients.
//
// A link is a sphere or a capsule: all points within a radius of a segment, its core. The other
// body is such a link, an obstacle that is a sphere or a capsule, or, if the link is a sphere, a
// solid (box, cylinder or half-space). With x and y the nearest points of the two cores and
// n = (x - y)/|x - y|,
//
//   ∇d = J_xᵀ n - J_yᵀ n,    d' = n · (x' - y'),
//
// where x' and y' include the motion of the nearest points along their cores. J_xᵀ n is the effort
// of the wrench (n, x × n) about the world's origin; the product rule gives its rate.
#pragma once
#include "nearest.hpp"

namespace hsp {

struct MeasureDistances {
  static constexpr const char* doc =
      "The distances of pairs of bodies, and the nearest points and normals of their cores.";
  InOutInts<1> measurements;  // counts the calls
  In<'j', 12> placements;     // of the joints, see WorldKinematics
  Bodies bodies;
  Ints<'u'> used;             // the bodies with segments that are in a pair
  Ints<'p', 3> pairs;         // two bodies, and the index of their distance
  InOut<'b', 2, 3> segments;  // start and axis in the world
  Out<'p', 3, 3> cores;       // x, y and n of each pair
  InOut<'d'> distances;       // [m]

  void check() const {
    bodies.check_joints(placements.rows());
    check_indices("used", used, bodies.kinds.rows());
    check_pairs(pairs, bodies, distances.size());
  }
  void operator()() {
    measurements[0] += 1;
    for (const Index i : used) {
      const auto [R, p] = placement_of(placements, bodies, i);
      const Vector3 start = bodies.sizes.row(i).head<3>(), axis = bodies.sizes.row(i).segment<3>(3);
      segments[i].row(0) = R * start + p;
      segments[i].row(1) = R * axis;
    }
    for (Index k = 0; k < pairs.rows(); ++k) {
      const Index i = pairs(k, 0), j = pairs(k, 1);
      const auto [distance, x, y, n] = nearest(i, j);
      cores[k].row(0) = x;
      cores[k].row(1) = y;
      cores[k].row(2) = n;
      distances[pairs(k, 2)] = distance - bodies.radius(i) - bodies.radius(j);
    }
  }

  Segment segment(Index i) const { return {segments[i].row(0), segments[i].row(1)}; }

  Nearest nearest(Index i, Index j) const {
    if (bodies.kind(j) == SEGMENT) return between_segments(segment(i), segment(j));
    return to_solid(bodies, j, segments[i].row(0));
  }
};

struct DistanceGradients {
  static constexpr const char* doc =
      "Σ b'(d_k) ∇d_k and its rate Σ (b'' d_k' ∇d_k + b' (∇d_k)'), after MeasureDistances.";
  WorldKinematics world;
  Bodies bodies;
  Ints<'p', 3> pairs;
  In<'b', 2, 3> segments;
  In<'d'> slopes, curvatures;  // b' and b'' of all distances
  Out<'n'> gradient, rate;

  void check() const {
    bodies.check_joints(world.placements.rows());
    bodies.check_columns(world.jacobian.cols(), gradient.size());
    check_pairs(pairs, bodies, slopes.size());
  }
  void operator()() {
    gradient.setZero();
    rate.setZero();
    for (Index k = 0; k < pairs.rows(); ++k) {
      const Index i = pairs(k, 0), j = pairs(k, 1);
      const double slope = slopes[pairs(k, 2)], curvature = curvatures[pairs(k, 2)];
      if (slope == 0.0 && curvature == 0.0) continue;
      const MovingNearest at = nearest(i, j);
      const double d_dot = at.n.dot(at.x_dot - at.y_dot);
      const Vector3 force = slope * at.n, force_dot = slope * at.n_dot + curvature * d_dot * at.n;
      push(i, at.x, at.x_dot, force, force_dot);
      if (bodies.is_link(j)) push(j, at.y, at.y_dot, -force, -force_dot);
    }
  }

  MovingSegment segment(Index i, const Twist& twist) const {
    const Vector3 start = segments[i].row(0), axis = segments[i].row(1);
    return {{start, axis}, twist.at(start), twist.angular.cross(axis)};
  }

  MovingNearest nearest(Index i, Index j) const {
    const Twist first = twist_of(world, bodies, i), second = twist_of(world, bodies, j);
    if (bodies.kind(j) == SEGMENT) return between_segments(segment(i, first), segment(j, second));
    const Vector3 x = segments[i].row(0);
    return to_solid(bodies, j, second, x, first.at(x));
  }

  // Add J(x)ᵀ f and its rate, J the linear Jacobian of a link's point. A joint that mimics another
  // has its own column, and the other's index in v.
  void push(Index i, const Vector3& x, const Vector3& x_dot, const Vector3& force,
            const Vector3& force_dot) {
    const auto columns = bodies.own_columns(i), dofs = bodies.own_dofs(i);
    const Vector6 w = wrench(x, force);
    Vector6 w_dot = wrench(x, force_dot);
    w_dot.tail<3>() += x_dot.cross(force);
    for (Index p = 0; p < columns.size(); ++p) {
      const auto J = world.jacobian.col(columns[p]), J_dot = world.jacobian_dot.col(columns[p]);
      gradient[dofs[p]] += J.dot(w);
      rate[dofs[p]] += J_dot.dot(w) + J.dot(w_dot);
    }
  }
};

struct AddForce {
  static constexpr const char* doc = "Add J(x)ᵀ f, J the linear Jacobian of a link's point x.";
  Columns<6, 'e'> jacobian;  // of all joints, in world axes at the world's origin
  Ints<'c'> columns, dofs;   // columns that move the link, and their indices in v
  In<3> point, force;
  InOut<'n'> out;

  void check() const {
    check_indices("columns", columns, jacobian.cols());
    check_indices("dofs", dofs, out.size());
  }
  void operator()() {
    const Vector6 w = wrench(point, force);
    for (Index p = 0; p < columns.size(); ++p) out[dofs[p]] += jacobian.col(columns[p]).dot(w);
  }
};

}  // namespace hsp
