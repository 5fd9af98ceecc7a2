// What a pseudo-inverse makes of a motion of tasks, and of joint efforts, outside of a step.
#pragma once
#include "pseudo_inverse.hpp"

namespace hsp {

struct InverseMemory {
  Scratch<'m', 'n'> B, Q;
  Scratch<'m', 'm'> X;
  Scratch<'m'> part;
  Scratch<'n'> y;
  void prepare(const Sizes& size) {
    for (auto* each : {&B, &Q}) each->prepare(size);
    X.prepare(size);
    part.prepare(size);
    y.prepare(size);
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
  InverseMemory memory;

  bool operator()() {
    auto& [B, Q, X, part, y] = memory;
    whiten(J, L, form, B);
    const bool damped = bounded_inverse(B, threshold, Q, X);
    PseudoInverse(Q, X, L, form).apply(x, part, motion);
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
  InverseMemory memory;

  bool operator()() {
    auto& [B, Q, X, part, y] = memory;
    whiten(J, L, form, B);
    const bool damped = bounded_inverse(B, threshold, Q, X);
    y = effort;
    PseudoInverse(Q, X, L, form).apply_transposed(y, part, force);
    return damped;
  }
};

}  // namespace hsp
