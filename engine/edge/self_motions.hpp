// What the law does to the null space alone, where a limit binds.
#pragma once
#include "resolve.hpp"

namespace hsp {

struct SelfMotions {
  static constexpr const char* doc = "Write P a of a and of a_damped, and K_N P v of both.";
  In<'m', 'n'> J;
  In<'n', 'n'> W, L;
  int form;
  In<'n'> v;
  In<'n', 'n'> K_N;
  bool alone;
  Factors<In> factors;
  In<'n', 'n'> projector;  // Q_K of the levels
  EdgeMemory<InOut> edge;
  Ints<1> damped_code;
  In<'n'> a;
  Out<2, 'n'> self_motions, brakings;
  struct Memory {
    Scratch<'n'> moved, exact, lowered;
    Scratch<'m'> Jx, part;
    void prepare(const Sizes& size) {
      for (auto* each : {&moved, &exact, &lowered}) each->prepare(size);
      for (auto* each : {&Jx, &part}) each->prepare(size);
    }
  } memory;

  void operator()() {
    auto& [moved, exact, lowered, Jx, part] = memory;
    const double mu = edge.share[0];
    const bool one_law = damped_code[0] == 0;
    if (one_law) edge.damped = a;
    damped_part(edge.damped, moved);
    self_motions.rowwise() = moved.transpose();
    damped_part(v, moved);
    exact.noalias() = K_N * moved;
    brakings.rowwise() = exact.transpose();
    if (one_law || mu == 1.0) return;
    exact_part(edge.exact, moved);
    self_motions.row(0) = moved.transpose() + mu * (self_motions.row(1) - moved.transpose());
    exact_part(v, moved);
    exact.noalias() = K_N * moved;
    brakings.row(0) = exact.transpose() + mu * (brakings.row(1) - exact.transpose());
  }

  // P x, with the inverse of the damped law.
  template <class X> void damped_part(const X& x, Scratch<'n'>& out) {
    if (damped_code[0] == 0 || alone) {
      part_of(factors.Q, factors.X, x, out);
    } else {
      memory.lowered.noalias() = W * x;
      out.noalias() = projector * memory.lowered;
    }
  }

  template <class X> void exact_part(const X& x, Scratch<'n'>& out) {
    part_of(edge.Q, edge.X, x, out);
  }

  // x - J# J x
  template <class Q, class F, class X>
  void part_of(const Q& q, const F& factor, const X& x, Scratch<'n'>& out) {
    memory.Jx.noalias() = J * x;
    PseudoInverse(q, factor, L, form).apply(memory.Jx, memory.part, out);
    out = x - out;
  }
};

}  // namespace hsp
