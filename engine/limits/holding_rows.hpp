// Gravity uses at most a share of every motor's effort: rows A a ≥ b for the motors near it.
//
//   h = share - |G|/limit,      h'' + 2α h' + α² h ≥ 0,      G'' = ∇G·a + its drift
#pragma once
#include <algorithm>
#include <hsp/indices.hpp>

#include "barrier_rows.hpp"

namespace hsp {

struct HoldingRows {
  static constexpr const char* doc =
      "Add the rows of motors near the share of their effort that gravity may use.";
  double share, bandwidth;
  double look_ahead;  // time over which the present growth is extrapolated [s]
  double near;        // the part of the share from which on a motor has a row
  Ints<'k'> motors;
  In<'n'> limit;  // of the efforts
  In<'n'> effort;
  In<'n', 'n'> slope;
  In<'n'> drift, v;  // of gravity's efforts, see Gravity
  BarrierRows<InOut, InOutInts> rows;

  void check() const { check_indices("motors", motors, limit.size()); }
  void operator()() {
    for (Index k = 0; k < motors.size(); ++k) {
      const Index i = motors[k];
      const double side = (effort[i] < 0.0 ? -1.0 : 1.0) / limit[i];
      const double used = side * effort[i], growth = side * slope.row(i).dot(v);
      if (used + look_ahead * std::max(growth, 0.0) <= near * share) continue;
      const Index r = rows.next();
      rows.A.row(r) = -side * slope.row(i);
      rows.least[r] =
          side * drift[i] + 2.0 * bandwidth * growth - bandwidth * bandwidth * (share - used);
    }
  }
};

}  // namespace hsp
