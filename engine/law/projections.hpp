// Products of a pseudo-inverse with a motion of tasks, and with joint efforts, outside of a step.
#pragma once
#include "pseudo_inverse.hpp"

namespace hsp {

// A bounded pseudo-inverse with its memory.
struct OwnInverse {
  Scratch<'m', 'n'> B, Q;
  Scratch<'m', 'm'> X, square;
  Scratch<'m'> part;
  void prepare(const Sizes& size) {
    for (auto* each : {&B, &Q}) each->prepare(size);
    for (auto* each : {&X, &square}) each->prepare(size);
    part.prepare(size);
  }

  // Find its factors; return whether it is damped.
  template <class J, class L>
  bool compute(const J& jacobian, const L& factor, int form, double threshold) {
    whiten(jacobian, factor, form, B);
    return bounded_inverse(B, threshold, Q, X, square);
  }
};

struct SmallestMotion {
  static constexpr const char* doc =
      "Write J# x, in a metric W = L Lᵀ; return whether it was damped.";
  In<'m', 'n'> J;
  In<'n', 'n'> L;
  int form;
  double threshold;
  In<'m'> x;
  Out<'n'> motion;
  OwnInverse inverse;

  bool operator()() {
    const bool damped = inverse.compute(J, L, form, threshold);
    PseudoInverse(inverse.Q, inverse.X, L, form).apply(x, inverse.part, motion);
    return damped;
  }
};

struct TaskForce {
  static constexpr const char* doc =
      "Write J#ᵀ τ, in a metric W = L Lᵀ; return whether it was damped.";
  In<'m', 'n'> J;
  In<'n', 'n'> L;
  int form;
  double threshold;
  In<'n'> effort;
  Out<'m'> force;
  Scratch<'n'> y;
  OwnInverse inverse;

  bool operator()() {
    const bool damped = inverse.compute(J, L, form, threshold);
    y = effort;
    PseudoInverse(inverse.Q, inverse.X, L, form).apply_transposed(y, inverse.part, force);
    return damped;
  }
};

}  // namespace hsp
