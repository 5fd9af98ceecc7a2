// The excess of a robot beyond its limits.
#pragma once
#include <hsp/indices.hpp>

namespace hsp {

struct LimitExcess {
  static constexpr const char* doc =
      "The maximum of its last value, q - upper and lower - q, and of |v| - speed, for each dof.";
  Ints<'k'> coordinates, dofs;  // indices in q and v of the joints with a range
  In<'q'> q;
  In<'n'> v, lower, upper, speed;
  InOut<'n'> position, velocity;

  void check() const {
    check_indices("coordinates", coordinates, q.size());
    check_indices("dofs", dofs, v.size());
  }
  void operator()() {
    for (Index k = 0; k < dofs.size(); ++k) {
      const Index i = dofs[k];
      const double x = q[coordinates[k]];
      position[i] = std::max({position[i], x - upper[i], lower[i] - x});
    }
    velocity = velocity.cwiseMax(v.cwiseAbs() - speed);
  }
};

}  // namespace hsp
