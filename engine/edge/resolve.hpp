// The two laws of the edge, one with bounded inverses and the exact one, and their blend.
#pragma once
#include "../law/outcome.hpp"
#include "damped_levels.hpp"
#include "shares.hpp"

namespace hsp {

// What the two laws leave.
template <template <int...> class As> struct EdgeMemory {
  As<'m', 'n'> Q;  // factors of the exact inverse
  As<'m', 'm'> X;
  As<'n'> exact;     // a_exact, where μ < 1 and the laws differ
  As<'n'> damped;    // a_damped, where they differ or a limit is violated
  As<'n'> by_tasks;  // a_damped without φ_N, where it went level by level
  As<'n'> exact_e_N;
  As<1> share;  // μ, without the share of the limits
};

struct Resolve {
  static constexpr const char* doc = "Write e_N and a, and what became of the law.";
  LawInput law;
  Asked rows;
  double least;  // ε_0
  Following following;
  bool exact_beside;  // whether there is an exact law beside the damped one
  bool alone;         // whether the tasks are one level, which is resolved at once
  Thresholds thresholds;
  Factors<InOut> factors;
  Projectors<InOut> projectors;
  EdgeMemory<InOut> edge;
  Out<'n'> e_N, a;
  OutInts<1> edge_level;  // the first level whose inverse the damped law bounds; 0: none
  LawOutcome<OutInts> outcome;

  struct Memory {
    LawMemory law;
    DampedMemory damped;
    LevelMemory levels;
    Scratch<'m', 'n'> B, turned;
    Scratch<'m', 'm'> square;
    void prepare(const Sizes& size) {
      law.prepare(size);
      damped.prepare(size);
      levels.prepare(size);
      B.prepare(size);
      turned.prepare(size);
      square.prepare(size);
    }
  } memory;

  void operator()() {
    edge_level[0] = outcome.damped_level[0] = alone ? at_once() : by_levels();
    blend();
    outcome.finite[0] = is_finite();
  }

  bool is_finite() const { return std::isfinite(a.sum()); }

  template <class Q, class X> auto inverse(const Q& q, const X& factor) const {
    return PseudoInverse(q, factor, law.metric.L, law.form);
  }

  // All tasks at once; return 1, the only level, if its inverse is bounded, else 0.
  int at_once() {
    auto& [Q, X] = factors;
    const bool damped = bounded_inverse(memory.B, write_whitened(), Q, X, memory.square);
    write_law(law, inverse(Q, X), memory.law, e_N, a);
    return damped ? 1 : 0;
  }

  // All levels at once, or level by level if they conflict. If the tasks of several levels are
  // exact together, they are exact one after the other: this is the same then. Return the first
  // level whose inverse is bounded, from 1 on; 0: none is.
  int by_levels() {
    const auto& J = law.task.jacobian;
    const double threshold = write_whitened();
    auto& [Q, X] = factors;
    if (J.rows() <= J.cols() && exact_inverse(memory.B, threshold, Q, X, memory.square)) {
      write_law(law, inverse(Q, X), memory.law, e_N, a);
      if (is_finite()) return 0;
    }
    return write_damped_levels(law, rows, least, following, thresholds, projectors, memory.damped,
                               memory.levels, edge.by_tasks, e_N, a);
  }

  // a = a_exact + μ (a_damped - a_exact); the first two shares count here, see `shares.hpp`. Where
  // μ = 0 the law is the exact one and the outcome says so; `edge_level` stays what the damped law
  // bounds, which the limits may still come near to.
  void blend() {
    auto& [Q, X, exact, damped, by_tasks, exact_e_N, share] = edge;
    if (edge_level[0] == 0) {
      share[0] = 0.0;
      return;
    }
    damped = a;
    share[0] = 1.0;
    if (!is_finite() || !exact_beside) return;
    double mu = far_share(rows.stretched, following.far);
    if (mu < 1.0) {
      const auto& J = law.task.jacobian;
      mu = std::max(mu, near_share(J, following.near, least, memory.turned, X, memory.square));
    }
    if (mu == 1.0) return;
    share[0] = mu;
    bounded_inverse(memory.B, 0.0, Q, X, memory.square);
    write_law(law, inverse(Q, X), memory.law, exact_e_N, a);
    exact = a;
    a += mu * (damped - exact);
    e_N = exact_e_N + mu * (e_N - exact_e_N);
    if (mu == 0.0) outcome.damped_level[0] = 0;
  }

  // Write B = J L⁻ᵀ and the thresholds; return a singular value from which on no level is bounded.
  double write_whitened() {
    const auto& J = law.task.jacobian;
    whiten(J, law.metric.L, law.form, memory.B);
    const double turning = turning_threshold(law.field.g, following);
    return write_thresholds(J, memory.B, rows, least, turning, following, thresholds);
  }
};

}  // namespace hsp
