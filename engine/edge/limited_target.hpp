// The acceleration that a step approximates while a limit is active.
//
// While a limit is active the law's equations cannot hold. Then it is decomposed,
//
//   a = a_t + φ_N,
//
// into the motion of the tasks and the self-motion. Two things change, each in proportion to the
// excess of a beyond a limit, so that the step is a continuous function of the state. With E the
// excess, relative to the permitted value, 1/(1 + E) is the part of the command that is within
// it.
//
// *The tasks are damped.* An arm at its workspace boundary, or moving fast towards it, commands
// more than its motors supply, with alternating signs: the nearest step within the limits would
// oscillate. So in proportion to the excess E_t of a_t alone, the step approaches the damped law,
// and reaches it at E_t = `large`.
//
// *The field's command is bounded.* That is φ_N + P K_N P v, the self-motion without its damping. A
// field's command is unbounded, r times the permitted one far from limits; it is scaled by
// 1/(1 + E), but not below 1/r. The damping is not scaled, or the null space would oscillate.
//
// Both begin slowly: a step that is reduced by more than its excess reverses its command where it
// begins to violate a limit, and oscillates about the limit (docs/edge.md).
//
// The permitted value is, for an effort, its maximum; for an acceleration, that of the barriers of
// `Limits` far from them. The limit on the effort's rate is ignored: it depends on the last effort,
// and a step that waited for it would wait for ever.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/records.hpp>

namespace hsp {

struct LimitedTarget {
  static constexpr const char* doc =
      "Overwrite the unconstrained acceleration by the target of the step.";
  In<'n', 'n'> M;
  InOut<'n'> a;       // the law's acceleration, plus the compensators' part
  InOut<'n'> effort;  // M a + N, plus the compensators' part
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
    In<'k', 'w'> A;    // the first n columns are used
    InOut<'k'> lower;  // for a deviation δ from a: A δ ≥ lower
  } barred;
  double large;  // E_t from which on the damped law applies fully
  Scratch<'n'> change, demand;
  Scratch<'n'> effort_change, effort_demand;  // M times them

  void check() const {
    check_at_least("a", a.size(), 1);
    check_at_least("the columns of barred.A", barred.A.cols(), a.size());
  }
  void operator()() {
    change = -parts.law_self_motion;
    effort_change.noalias() = M * change;
    const double of_tasks = excess();
    change.setZero();
    effort_change.setZero();
    const double beyond = std::min(of_tasks, excess());
    const double damped = std::min(beyond / large, 1.0);

    change = damped * (parts.damped - parts.law);
    effort_change.noalias() = M * change;
    demand = (1.0 - damped) * (parts.law_self_motion + parts.law_braking);
    demand += damped * (parts.damped_self_motion + parts.damped_braking);
    effort_demand.noalias() = M * demand;
    const double lost = 1.0 - 1.0 / std::min(1.0 + excess(), times_permitted());
    change -= lost * demand;
    effort_change -= lost * effort_demand;

    a += change;
    effort += effort_change;
    barred.lower.noalias() -= barred.A.leftCols(a.size()) * change;
  }

  // Excess of a + change beyond limits, relative to the permitted values.
  double excess() const {
    const auto efforts = (effort + effort_change).array().abs() / permitted.effort.array();
    const auto above = (a + change - bounds.upper).array();
    const auto below = (bounds.lower - a - change).array();
    const auto motions = above.max(below) / permitted.acceleration.array();
    double most = std::max({0.0, greatest(efforts) - 1.0, greatest(motions)});
    const double least = a.size() ? permitted.acceleration.minCoeff() : 0.0;
    for (Index r = 0; r < barred.lower.size(); ++r) {
      const auto row = barred.A.row(r).head(change.size());
      const double missing = barred.lower[r] - row.dot(change.transpose());
      if (missing > 0.0) most = std::max(most, missing / (row.norm() * least));
    }
    return most;
  }

  // Demand relative to the permitted one far from limits; at least 1.
  double times_permitted() const {
    const double efforts = greatest(effort_demand.array().abs() / permitted.effort.array());
    const double motions = greatest(demand.array().abs() / permitted.acceleration.array());
    return std::max({1.0, efforts, motions});
  }
};

}  // namespace hsp
