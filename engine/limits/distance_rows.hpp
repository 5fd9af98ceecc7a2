// Minimum distances as rows ∇d·a ≥ b, for the pairs that need one.
//
//   d'' + 2α d' + α² (d - minimum) ≥ 0,      d'' = ∇d·a + the drift of d'
//
// The rate and the drift are differences of the distances a span behind and ahead at the present
// velocity, which include the motion of the obstacles and of the nearest points.
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

#include "../geometry/bodies.hpp"
#include "../src/move.hpp"
#include "barrier_rows.hpp"

namespace hsp {

struct Displace {
  static constexpr const char* doc = "displaced = q + h x, for a robot whose q is a vector.";
  double h;
  In<'n'> q, x;
  Out<'n'> displaced;

  void operator()() { displaced = q + h * x; }
};

struct DistancesAt {
  static constexpr const char* doc =
      "Move another state of the robot, whose move measures distances, and keep these.";
  Shared<Move> move;
  In<1> time;
  double later;  // offset of its time from `time` [s]
  In<'q'> q;
  In<'n'> v;
  In<'d'> measured;  // written by the move
  Out<'d'> distances;

  void check() const { move->check_moved_by(q, v); }
  void operator()() {
    if (move->to(time[0] + later, q, v)) distances = measured;
    else distances.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
};

// Displacement of joints along an acceleration for its effect on distances [rad]; no joint moves a
// point by more than the robot's size per radian.
struct Turning {
  double turn, size;

  template <class A> double most(const A& a) const { return std::sqrt(a.size() * a.squaredNorm()); }
  template <class A> double step(const A& a) const { return turn / std::max(most(a), 1.0); }
};

struct NearPairs {
  static constexpr const char* doc =
      "The least ∇d·a of each pair, which pairs are or come close, and whether the unconstrained "
      "acceleration may be too much for others.";
  double minimum, bandwidth, span;
  double look_ahead;  // time over which a pair's rate is extrapolated [s]
  Turning turning;
  In<'d'> now, ahead, behind;
  In<'n'> a;  // the unconstrained acceleration
  Out<'d'> least;
  OutInts<'d'> near;
  Out<'n'> displacement;
  OutInts<1> turning_matters;

  void operator()() {
    double others = -std::numeric_limits<double>::infinity();
    for (Index k = 0; k < now.size(); ++k) {
      const double rate = (ahead[k] - behind[k]) / (2.0 * span);
      const double drift = (ahead[k] - 2.0 * now[k] + behind[k]) / (span * span);
      const double left = now[k] - minimum;
      least[k] = -drift - 2.0 * bandwidth * rate - bandwidth * bandwidth * left;
      near[k] = left + look_ahead * std::min(rate, 0.0) < 2.0 / bandwidth;
      if (!near[k]) others = std::max(others, least[k]);
    }
    displacement = turning.step(a) * a;
    turning_matters[0] = others > -2.0 * turning.size * turning.most(a);
  }
};

struct ApproachedPairs {
  static constexpr const char* doc =
      "Add the pairs for which the acceleration uses half of the permitted approach.";
  Turning turning;
  In<'d'> now, turned, least;
  In<'n'> a;
  InOutInts<'d'> near;

  void operator()() {
    for (Index k = 0; k < now.size(); ++k)
      if ((turned[k] - now[k]) / turning.step(a) < 0.5 * least[k]) near[k] = 1;
  }
};

struct DistanceRows {
  static constexpr const char* doc = "Add the rows of some pairs, after MeasureDistances.";
  Columns<6, 'e'> jacobian;  // of all joints, in world axes at the world's origin
  Bodies bodies;
  Ints<'p', 3> pairs;
  In<'p', 3, 3> cores;  // x, y and n of each pair
  Ints<'d'> near;
  In<'d'> least_of_all;
  BarrierRows<InOut, InOutInts> rows;

  void check() const {
    bodies.check_columns(jacobian.cols(), rows.A.cols());
    check_pairs(pairs, bodies, near.size());
  }
  void operator()() {
    for (Index k = 0; k < pairs.rows(); ++k) {
      const Index i = pairs(k, 0), j = pairs(k, 1), place = pairs(k, 2);
      if (!near[place]) continue;
      const Index r = rows.next();
      const Vector3 x = cores[k].row(0), y = cores[k].row(1), n = cores[k].row(2);
      rows.A.row(r).setZero();
      add_gradient(i, x, n, r);
      if (bodies.is_link(j)) add_gradient(j, y, -n, r);
      rows.least[r] = least_of_all[place];
    }
  }

 private:
  // Add J(x)ᵀ n, J the linear Jacobian of a link's point.
  void add_gradient(Index i, const Vector3& x, const Vector3& n, Index r) {
    const auto columns = bodies.own_columns(i), dofs = bodies.own_dofs(i);
    const Vector6 w = wrench(x, n);
    for (Index p = 0; p < columns.size(); ++p)
      rows.A(r, dofs[p]) += jacobian.col(columns[p]).dot(w);
  }
};

}  // namespace hsp
