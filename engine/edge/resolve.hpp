// The two laws at the workspace boundary, with bounded and with exact inverses, and their blend.
#pragma once
#include "../law/outcome.hpp"
#include "damped_levels.hpp"
#include "shares.hpp"

namespace hsp {

// Results of the two laws.
template <template <int...> class As> struct EdgeMemory {
  As<'m', 'n'> Q;  // factors of the exact inverse
  As<'m', 'm'> X;
  As<'n'> exact;     // a_exact, where μ < 1 and the laws differ
  As<'n'> damped;    // a_damped, where they differ and it is computed
  As<'n'> by_tasks;  // a_damped without φ_N, where it was computed level by level
  As<'n'> exact_e_N;
  As<1> share;  // μ, without the share of the limits
};

struct Resolve {
  static constexpr const char* doc = "Write e_N and a, and the outcome of the law.";
  LawInput law;
  Demand rows;
  double least;  // ε_0
  Following following;
  bool exact_beside;  // whether there is an exact law beside the damped one
  bool alone;         // whether the tasks are one level, which is resolved at once
  bool beside;        // whether the damped law is written even where μ = 0
  Thresholds thresholds;
  Factors<InOut> factors;
  Projectors<InOut> projectors;
  EdgeMemory<InOut> edge;
  Out<'n'> e_N, a;
  OutInts<1> edge_level;  // the first level whose inverse the damped law bounds; 0: none
  OutInts<1> left_out;    // whether μ = 0, and the damped law was not written
  LawOutcome<OutInts> outcome;

  struct Memory {
    LawMemory law;
    DampedMemory damped;
    LevelMemory levels;
    Scratch<'m', 'n'> B, turned;
    Scratch<'m', 'm'> square;
    SymmetricSpectrum spectrum;
    void prepare(const Sizes& size) {
      law.prepare(size);
      damped.prepare(size);
      levels.prepare(size);
      B.prepare(size);
      turned.prepare(size);
      square.prepare(size);
      // Once, for its memory. Eigen's constructor of a size leaves the values undefined.
      if (const Index m = size('m'); m > 0)
        spectrum.compute(Eigen::MatrixXd::Identity(m, m), Eigen::EigenvaluesOnly);
    }
  } memory;

  void operator()() {
    const double threshold = write_whitened();
    if (!exact_throughout(threshold)) blend(threshold);
    outcome.finite[0] = is_finite();
  }

  bool is_finite() const { return std::isfinite(a.sum()); }

  template <class Q, class X> auto inverse(const Q& q, const X& factor) const {
    return PseudoInverse(q, factor, law.metric.L, law.form);
  }

  // Write the exact law, if no inverse is bounded; return whether that is so. If the tasks of
  // several levels are exact together, they are exact one after the other: this is the same then.
  bool exact_throughout(double threshold) {
    edge_level[0] = outcome.damped_level[0] = left_out[0] = 0;
    edge.share[0] = 0.0;
    auto& [Q, X] = factors;
    const auto& J = law.task.jacobian;
    if (J.rows() > J.cols()) return false;
    const bool exact = exact_inverse(memory.B, threshold, Q, X, memory.square);
    X.array().rowwise() /= thresholds.units.transpose().array();
    if (!exact) return false;
    write_law(law, inverse(Q, X), memory.law, e_N, a);
    return alone || is_finite();
  }

  // a = a_exact + μ (a_damped - a_exact); with the first two shares, see `shares.hpp`. Where
  // μ = 0 the law is the exact one; the outcome reports it. Only limits may need the damped one
  // then, which is skipped until they do.
  void blend(double threshold) {
    auto& [Q, X, exact, damped, by_tasks, exact_e_N, share] = edge;
    const double mu = exact_beside ? share_of_damped() : 1.0;
    if (mu < 1.0) {
      Q = factors.Q;
      X = factors.X;
      write_law(law, inverse(Q, X), memory.law, exact_e_N, exact);
    }
    left_out[0] = mu == 0.0 && !beside;
    if (left_out[0]) {
      a = exact;
      e_N = exact_e_N;
      return;
    }
    edge_level[0] = alone ? damped_at_once(threshold) : damped_by_levels();
    damped = a;
    if (mu < 1.0) {
      a = exact + mu * (damped - exact);
      e_N = exact_e_N + mu * (e_N - exact_e_N);
    }
    if (edge_level[0] == 0) return;
    share[0] = mu;
    if (mu > 0.0) outcome.damped_level[0] = edge_level[0];
  }

  double share_of_damped() {
    const double far = far_share(rows.stretched, following.far);
    if (far == 1.0) return far;
    const auto& J = law.task.jacobian;
    return std::max(far, near_share(J, following.near, least, memory.turned, edge.X, memory.square,
                                    memory.spectrum));
  }

  // All tasks at once. Their level is marked as bounded, by `exact_inverse`, also where rounding
  // makes its smallest singular value the threshold: Q then has the rows of a spectrum.
  int damped_at_once(double threshold) {
    auto& [Q, X] = factors;
    damped_inverse(memory.B, threshold, Q, X);
    X.array().rowwise() /= thresholds.units.transpose().array();
    write_law(law, inverse(Q, X), memory.law, e_N, a);
    return 1;
  }

  // Level by level; return the first one whose inverse is bounded, from 1 on; 0: none is.
  int damped_by_levels() {
    return write_damped_levels(law, rows, least, following, thresholds, projectors, memory.damped,
                               memory.levels, edge.by_tasks, e_N, a);
  }

  // Write B = D⁻¹ J L⁻ᵀ and the thresholds; return a singular value of B from which on no level is
  // bounded. Of the inverses of B the factor X becomes that of J L⁻ᵀ by X D⁻¹.
  double write_whitened() {
    const auto& J = law.task.jacobian;
    whiten(J, law.metric.L, law.form, memory.B);
    const double turning = turning_threshold(law.field.g, following);
    write_units(J, memory.B, rows, following, thresholds);
    return write_thresholds(rows, least, turning, following, thresholds);
  }
};

}  // namespace hsp
