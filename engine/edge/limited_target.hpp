// The acceleration that a step approximates while a limit is active.
//
// While a limit is active the law's equations cannot hold. Then it is decomposed,
//
//   a = a_t + φ_N,
//
// into the motion of the tasks and the self-motion. Two things change, as continuous functions of
// the state. With E the excess of a beyond a limit, relative to the permitted value, 1/(1 + E) is
// the part of the command that is within it.
//
// *The tasks are damped*, with the share of the limits in μ (`limit_share.hpp`).
//
// *The field's command is bounded.* That is φ_N + P K_N P v, the self-motion without its damping. A
// field's command is unbounded, r times the permitted one far from limits; it is scaled by
// 1/(1 + E), but not below 1/r. The damping is not scaled, or the null space would oscillate.
//
// Both begin slowly: a step that is reduced by more than its excess reverses its command where it
// begins to violate a limit, and oscillates about the limit (docs/edge.md).
#pragma once
#include "excess.hpp"

namespace hsp {

struct LimitedTarget {
  static constexpr const char* doc =
      "Overwrite the unconstrained acceleration by the target of the step.";
  Wanted<InOut> wanted;
  struct {
    In<'n'> law, damped;
    In<'n'> law_self_motion, damped_self_motion;  // φ_N
    In<'n'> law_braking, damped_braking;          // P K_N P v
  } parts;
  StepLimits<InOut> limits;
  In<1> share;  // of the damped law, by limits
  Scratch<'n'> change, demand;
  Scratch<'n'> effort_change, effort_demand;  // M times them

  void check() const { check_at_least("a", wanted.acceleration.size(), 1); }
  void operator()() {
    auto& [M, a, effort] = wanted;
    const double damped = share[0];
    change = damped * (parts.damped - parts.law);
    effort_change.noalias() = M * change;
    demand = (1.0 - damped) * (parts.law_self_motion + parts.law_braking);
    demand += damped * (parts.damped_self_motion + parts.damped_braking);
    effort_demand.noalias() = M * demand;
    const double E = limits.excess(a, change, effort + effort_change);
    const double r = std::max(1.0, limits.permitted.ratio(demand, effort_demand));
    const double lost = 1.0 - 1.0 / std::min(1.0 + E, r);
    change -= lost * demand;
    effort_change -= lost * effort_demand;

    a += change;
    effort += effort_change;
    limits.least.noalias() -= limits.rows.leftCols(a.size()) * change;
  }
};

}  // namespace hsp
