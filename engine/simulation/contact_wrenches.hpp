// The wrenches of contacts on the touching bodies.
#pragma once
#include <hsp/indices.hpp>
#include <limits>

namespace hsp {

struct AddContactWrenches {
  static constexpr const char* doc =
      "Add each contact's wrench to its second body, and the opposite to the first.";
  Ints<'k', 2> touched;  // rows of the sums; negative: none
  In<'k', 3> positions;  // of the contacts in the world
  In<'k', 3, 3> frames;  // the rows are the axes of a contact in the world
  In<'k', 6> wrenches;   // force and moment, in those axes
  In<'m', 3> origins;    // reference points of the moments of the sums
  InOut<'m', 6> sums;    // in world axes

  void check() const {
    check_indices("touched", touched, sums.rows(), std::numeric_limits<Index>::min());
  }
  void operator()() {
    for (Index k = 0; k < touched.rows(); ++k) {
      const Eigen::RowVector3d force = wrenches.row(k).head<3>() * frames[k];
      const Eigen::RowVector3d moment = wrenches.row(k).tail<3>() * frames[k];
      for (int side = 0; side < 2; ++side) {
        const Index i = touched(k, side);
        if (i < 0) continue;
        const double sign = side == 1 ? 1.0 : -1.0;
        const Eigen::RowVector3d arm = positions.row(k) - origins.row(i);
        sums.row(i).head<3>() += sign * force;
        sums.row(i).tail<3>() += sign * (moment + arm.cross(force));
      }
    }
  }
};

}  // namespace hsp
