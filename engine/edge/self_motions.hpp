// The law's part in the null space, while a limit is active.
//
//   a = a_t + φ_N,      φ_N = P u
//
// of each of the two laws. Where an inverse is bounded P is not a projector: P a is less than φ_N,
// and the difference would appear as a command of the tasks.
#pragma once
#include "resolve.hpp"

namespace hsp {

struct SelfMotions {
  static constexpr const char* doc = "Write φ_N of a and of a_damped, and their damping P K_N P v.";
  In<'m', 'n'> J, J_dot;
  In<'m'> a_x;
  In<'n', 'n'> W, L;
  int form;
  In<'n'> v;
  In<'n', 'n'> K_N;
  bool alone;
  Factors<In> factors;
  In<'n', 'n'> Q_K;  // P W⁻¹ of the levels
  EdgeMemory<InOut> edge;
  Ints<1> edge_level;
  In<'n'> a;
  Out<2, 'n'> self_motions, brakings;
  struct Memory {
    Scratch<'n'> self_motion, braking, exact, moved, lowered;
    Scratch<'m'> missing, part;
    void prepare(const Sizes& size) {
      for (auto* each : {&self_motion, &braking, &exact, &moved, &lowered}) each->prepare(size);
      for (auto* each : {&missing, &part}) each->prepare(size);
    }
  } memory;

  void operator()() {
    auto& [self_motion, braking, exact, moved, lowered, missing, part] = memory;
    const bool one_law = edge_level[0] == 0;
    if (one_law) edge.damped = a;
    if (one_law || alone) {
      const auto inverse = PseudoInverse(factors.Q, factors.X, L, form);
      write_self_motion(inverse, edge.damped, self_motion);
      write_braking(inverse, braking);
    } else {
      self_motion = edge.damped - edge.by_tasks;
      project(v, moved);
      exact.noalias() = K_N * moved;
      project(exact, braking);
    }
    self_motions.rowwise() = self_motion.transpose();
    brakings.rowwise() = braking.transpose();

    const double mu = edge.share[0];
    if (one_law || mu == 1.0) return;
    const auto inverse = PseudoInverse(edge.Q, edge.X, L, form);
    write_self_motion(inverse, edge.exact, exact);
    self_motions.row(0) = (exact + mu * (self_motion - exact)).transpose();
    write_braking(inverse, exact);
    brakings.row(0) = (exact + mu * (braking - exact)).transpose();
  }

  // φ_N = a - J# (a_x - J'v)
  template <class Inverse, class A>
  void write_self_motion(const Inverse& inverse, const A& acceleration, Scratch<'n'>& out) {
    memory.missing = a_x;
    memory.missing.noalias() -= J_dot * v;
    inverse.apply(memory.missing, memory.part, out);
    out = acceleration - out;
  }

  // P K_N P v, with P = I - J# J
  template <class Inverse> void write_braking(const Inverse& inverse, Scratch<'n'>& out) {
    auto& [self_motion, braking, exact, moved, lowered, missing, part] = memory;
    missing.noalias() = J * v;
    inverse.apply(missing, part, moved);
    moved = v - moved;
    lowered.noalias() = K_N * moved;
    missing.noalias() = J * lowered;
    inverse.apply(missing, part, out);
    out = lowered - out;
  }

  // P x = Q_K W x
  template <class X> void project(const X& x, Scratch<'n'>& out) {
    memory.lowered.noalias() = W * x;
    out.noalias() = Q_K * memory.lowered;
  }
};

}  // namespace hsp
