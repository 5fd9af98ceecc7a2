// Whether the law's acceleration and its effort are within all limits.
#pragma once
#include <algorithm>
#include <cmath>

#include "../law/outcome.hpp"
#include "acceleration_bounds.hpp"
#include "sent_effort.hpp"

namespace hsp {

struct IsPlain {
  static constexpr const char* doc =
      "Whether the law is exact and within all limits: otherwise its outcome and theirs have "
      "the reason, unless only a QP has found the nearest step.";
  LawOutcome<Ints> law;
  LimitsOutcome<Ints> limits;
  QPOutcome<Ints> qp;
  std::int64_t limited;  // the status of a nearest step
  OutInts<1> nearest;    // whether only that was found

  bool operator()() {
    const bool exact = law.finite[0] && law.damped_level[0] == 0 && !limits.beyond[0];
    nearest[0] = exact && limits.violated[0] && !qp.unsolved[0] && qp.status[0] == limited;
    return exact && !limits.violated[0];
  }
};

struct CheckLimits {
  static constexpr const char* doc =
      "Observe the last period's effort, write the bounds, and compare a and tau with them.";
  In<1> time;
  In<'q'> q;
  In<'n'> v, a, tau;
  Ints<'n'> where;
  MotionLimits<In> limits;
  Ends<In> ends;
  Held<InOut> held;
  Bounds<Out, In> bounds;
  LimitsOutcome<OutInts> outcome;
  OutInts<1> unsolved;  // 1: until one is solved, there is no result of a QP

  void check() const { check_indices("where", where, q.size(), -1); }
  void operator()() {
    observe(v, held, time[0]);
    write_acceleration_bounds(q, v, where, limits, held, bounds.a_lower, bounds.a_upper);
    move_bounds();
    outcome.motion[0] = !is_within(a, bounds.a_lower, bounds.a_upper);
    outcome.effort[0] = !is_within(tau, bounds.tau_lower, bounds.tau_upper);
    outcome.rows[0] = 0;  // until `CheckRows` finds one
    outcome.violated[0] = outcome.motion[0] || outcome.effort[0];
    outcome.beyond[0] = is_beyond();
    unsolved[0] = 1;
  }

 private:
  // The robot accelerates by a plus the known external disturbance, so the bounds on a are shifted
  // by it. A bound is narrowed by no more than the speed's barrier permits at rest, so that the end
  // of a push does no harm.
  void move_bounds() {
    const auto brake = 2.0 * limits.bandwidth[0] * limits.velocity.array();
    const auto up = held.disturbance.array().max(0.0);
    const auto down = held.disturbance.array().min(0.0);
    bounds.a_lower.array() -= up + down.max(-brake);
    bounds.a_upper.array() -= up.min(brake) + down;
  }

  bool is_beyond() const {
    if ((v.array().abs() > ends.velocity.array()).any()) return true;
    for (Index i = 0; i < v.size(); ++i)
      if (where[i] >= 0 && !(ends.lower[i] <= q[where[i]] && q[where[i]] <= ends.upper[i]))
        return true;
    return false;
  }
};

}  // namespace hsp
