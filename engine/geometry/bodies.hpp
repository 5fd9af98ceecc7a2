// Links and obstacles, their placements and motions.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/kind.hpp>

#include "segments.hpp"
#include "solids.hpp"

namespace hsp {

using Vector6 = Eigen::Matrix<double, 6, 1>;

// Placements and Jacobians of all joints.
struct WorldKinematics {
  In<'j', 12> placements;                  // R, column by column, and the origin
  Columns<6, 'e'> jacobian, jacobian_dot;  // in world axes at the world's origin
  In<'n'> v;
};

// Links, then obstacles.
struct Bodies {
  // kind, joint (-1 - k for the k-th obstacle), and where the columns of the joint begin and end
  Ints<'b', 4> kinds;
  In<'b', 7> sizes;    // segment and radius, or half sizes, in the body's own frame
  In<'o', 18> motion;  // of the obstacles: R, row by row, c, c' and ω
  Ints<'c'> columns;   // the columns of the Jacobian that move each link
  Ints<'c'> dofs;      // the indices in v of these columns

  void check() const {
    for (Index i = 0; i < kinds.rows(); ++i)
      if (is_link(i)) check_range("a link", kinds(i, 2), kinds(i, 3), columns.size());
    check_indices("kinds", kinds.col(0), HALF_SPACE + 1);
  }
  // Throws if the joints, the Jacobian or v are those of another robot.
  void check_joints(Index joints) const {
    check_indices("the joints of kinds", kinds.col(1), joints, -motion.rows());
  }
  void check_columns(Index all_columns, Index all_dofs) const {
    check_indices("columns", columns, all_columns);
    check_indices("dofs", dofs, all_dofs);
  }

  std::int64_t kind(Index i) const { return kinds(i, 0); }
  bool is_link(Index i) const { return kinds(i, 1) >= 0; }
  Vector3 size(Index i) const { return sizes.row(i).head<3>(); }
  double radius(Index i) const { return sizes(i, 6); }
  auto own_columns(Index i) const {
    return columns.segment(kinds(i, 2), kinds(i, 3) - kinds(i, 2));
  }
  auto own_dofs(Index i) const { return dofs.segment(kinds(i, 2), kinds(i, 3) - kinds(i, 2)); }
};

// Pairs are a link, a body, and the index of their distance; a link's core is a segment, only
// obstacles are solids.
template <class Pairs> void check_pairs(const Pairs& pairs, const Bodies& bodies, Index distances) {
  check_indices("pairs", pairs.template leftCols<2>(), bodies.kinds.rows());
  check_indices("the places of pairs", pairs.col(2), distances);
  for (Index k = 0; k < pairs.rows(); ++k) {
    if (!bodies.is_link(pairs(k, 0)))
      throw std::invalid_argument("pairs begin with links; body " + std::to_string(pairs(k, 0)) +
                                  " is an obstacle");
    for (const Index i : {pairs(k, 0), pairs(k, 1)})
      if (bodies.is_link(i) && bodies.kind(i) != SEGMENT)
        throw std::invalid_argument("links are segments; body " + std::to_string(i) +
                                    " is a solid");
  }
}

struct Placement {
  Matrix3 R;
  Vector3 p;
};

// The velocity of a body's point at the world's origin, and ω.
struct Twist {
  Vector3 linear, angular;

  Vector3 at(const Vector3& x) const { return linear + angular.cross(x); }
};

inline Placement placement_of_obstacle(const Bodies& bodies, Index i) {
  const double* row = bodies.motion.row(-1 - bodies.kinds(i, 1)).data();
  return {Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(row),
          Eigen::Map<const Vector3>(row + 9)};
}

template <class Placements>
Placement placement_of(const Placements& placements, const Bodies& bodies, Index i) {
  if (!bodies.is_link(i)) return placement_of_obstacle(bodies, i);
  const double* row = placements.row(bodies.kinds(i, 1)).data();
  return {Eigen::Map<const Matrix3>(row), Eigen::Map<const Vector3>(row + 9)};
}

inline Twist twist_of(const WorldKinematics& world, const Bodies& bodies, Index i) {
  if (!bodies.is_link(i)) {
    const double* row = bodies.motion.row(-1 - bodies.kinds(i, 1)).data();
    const Eigen::Map<const Vector3> c(row + 9), c_dot(row + 12), angular(row + 15);
    return {c_dot - angular.cross(c), angular};
  }
  const auto columns = bodies.own_columns(i), dofs = bodies.own_dofs(i);
  Vector6 twist = Vector6::Zero();
  for (Index p = 0; p < columns.size(); ++p)
    twist += world.jacobian.col(columns[p]) * world.v[dofs[p]];
  return {twist.head<3>(), twist.tail<3>()};
}

// A force at x as a wrench about the world's origin: f and x × f. A joint's column of J times a
// wrench is its effort.
inline Vector6 wrench(const Vector3& x, const Vector3& force) {
  Vector6 found;
  found.head<3>() = force;
  found.tail<3>() = x.cross(force);
  return found;
}

}  // namespace hsp
