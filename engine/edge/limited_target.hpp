// What a step comes near to where a limit binds, and how dear the null space is then.
//
// The law promises nothing where a limit binds. Then it is taken apart,
//
//   a = a_t + φ_N,
//
// into what moves the tasks and the self-motion. Two things change, as far as a is beyond a limit,
// so that the step is a continuous function of the state:
//
// *The tasks are damped.* An arm that is held at its edge, or rushes to it, asks for more than its
// motors give, from one side and then from the other: the nearest step within the limits would
// swing with it. So as far as a_t alone is beyond the limits, the step comes near to the damped
// law.
//
// *What a field asks for is bounded.* That is φ_N + P K_N P v, the self-motion without what brakes
// it. A field may ask for anything; at most what the limits permit far from them is asked of the
// QP, and what brakes stays whole: else it would swing.
//
// An excess is relative to what the limit permits: of an effort, the maximum; of an acceleration,
// what the barriers of `Limits` permit far from them. The limit on the effort's rate does not
// count: it depends on the last effort, and a step that waits for it would wait for ever.
#pragma once
#include <hsp/records.hpp>

namespace hsp {

struct LimitedTarget {
  static constexpr const char* doc =
      "Overwrite what is wanted by what the step is to come near to.";
  In<'n', 'n'> M;
  InOut<'n'> a;       // the law's acceleration, and what compensators add
  InOut<'n'> effort;  // M a + N, and what compensators add
  struct {
    In<'n'> law, damped;
    In<'n'> law_self_motion, damped_self_motion;  // φ_N
    In<'n'> law_braking, damped_braking;          // P K_N P v
  } parts;
  struct {
    In<'n'> lower, upper;
  } bounds;  // on a
  struct {
    In<'n'> effort, acceleration;  // inf where there is no limit
  } permitted;                     // far from the limits
  struct {
    In<'k', 'w'> A;    // the first n columns count
    InOut<'k'> lower;  // for a deviation δ from a: A δ ≥ lower
  } barred;
  double large;  // the excess from which on it counts wholly
  Scratch<'n'> a_t, tau_t, change, part, asked;

  void operator()() {
    change.setZero();
    const double whole = excess(a, effort, change);
    part.noalias() = M * parts.law_self_motion;
    a_t = a - parts.law_self_motion;
    tau_t = effort - part;
    change = -parts.law_self_motion;
    const double tasks = std::min(excess(a_t, tau_t, change), whole);

    change = tasks * (parts.damped - parts.law);
    asked = parts.law_self_motion + parts.law_braking;
    change -= whole * (1.0 - tasks) * (1.0 - permitted_part(asked)) * asked;
    asked = parts.damped_self_motion + parts.damped_braking;
    change -= whole * tasks * (1.0 - permitted_part(asked)) * asked;

    a += change;
    part.noalias() = M * change;
    effort += part;
    barred.lower.noalias() -= barred.A.leftCols(a.size()) * change;
  }

  // By how much an acceleration that differs by δ from a is beyond limits, from 0 to 1.
  template <class A, class Tau, class D>
  double excess(const A& x, const Tau& tau, const D& difference) const {
    const auto beyond = (x - bounds.upper).cwiseMax(bounds.lower - x).array();
    double most = std::max(0.0, (tau.array().abs() / permitted.effort.array()).maxCoeff() - 1.0);
    most = std::max(most, (beyond / permitted.acceleration.array()).maxCoeff());
    const double least = permitted.acceleration.minCoeff();
    for (Index r = 0; r < barred.lower.size(); ++r) {
      const auto row = barred.A.row(r).head(x.size());
      const double missing = barred.lower[r] - row.dot(difference.transpose());
      if (missing > 0.0) most = std::max(most, missing / (row.norm() * least));
    }
    return std::min(most / large, 1.0);
  }

  // Which part of an acceleration the limits permit far from them.
  template <class A> double permitted_part(const A& x) {
    part.noalias() = M * x;
    const double efforts = (part.array().abs() / permitted.effort.array()).maxCoeff();
    const double motions = (x.array().abs() / permitted.acceleration.array()).maxCoeff();
    return 1.0 / std::max({1.0, efforts, motions});
  }
};

}  // namespace hsp
