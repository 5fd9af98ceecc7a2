// The velocity at the end of a step with dry friction.
#pragma once
#include <algorithm>
#include <hsp/view.hpp>

namespace hsp {

struct DryFriction {
  static constexpr const char* doc =
      "Move x to the minimum of ½ xᵀA x - bᵀx + Σ c_i |x_i|, A positive definite.";
  In<'n', 'n'> A;
  In<'n'> b, c;
  InOut<'n'> x;

  // Coordinate by coordinate: x_i = S(b_i - Σ_{k≠i} A_ik x_k, c_i)/A_ii, where S moves its first
  // argument towards zero by its second.
  void operator()() {
    for (int sweep = 0; sweep < 10'000; ++sweep) {
      double change = 0.0, size = 1e-9;
      for (Index i = 0; i < x.size(); ++i) {
        const double rest = b[i] - A.row(i).dot(x) + A(i, i) * x[i];
        const double next = (rest - std::clamp(rest, -c[i], c[i])) / A(i, i);
        change = std::max(change, std::abs(next - x[i]));
        size = std::max(size, std::abs(next));
        x[i] = next;
      }
      if (change <= 1e-13 * size) return;
    }
  }
};

}  // namespace hsp
