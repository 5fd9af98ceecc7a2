// Whether the law's acceleration and its effort are within all limits.
#pragma once
#include <algorithm>
#include <cmath>

#include "acceleration_bounds.hpp"
#include "sent_effort.hpp"

namespace hsp {

// What is violated: bounds on the acceleration, bounds on the effort; and whether the robot is
// beyond a limit. The sum is written.
enum Violated { MOTION = 1, EFFORT = 2, BEYOND = 4 };

// What a check returns, or more, where a limit is violated or the law is not finite. Where neither
// is the case it returns 0, or 1 if an inverse is bounded.
constexpr double LOOK = 2.0;

// From the code `not_finite` of the law on, its acceleration is not finite.
inline double look_at_law(std::int64_t code, double not_finite) {
  if (code >= not_finite) return LOOK;
  return code > 0 ? 1.0 : 0.0;
}

struct CheckLaw {
  static constexpr const char* doc = "What `CheckLimits` does where nothing is limited.";
  Ints<1> code;
  double not_finite;
  OutInts<2> found;

  double operator()() {
    found.setZero();
    return look_at_law(code[0], not_finite);
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
  Ints<1> code;       // the law's outcome
  double not_finite;  // its code from which on a is not finite
  OutInts<2> found;   // which limits the next effort violates; and 0, no QP was solved
  Out<2> solve_if;    // what is returned, and whether a bound is violated

  double operator()() {
    observe(v, held, time[0]);
    write_acceleration_bounds(q, v, where, limits, held, bounds.a_lower, bounds.a_upper);
    move_bounds();
    const int flags = (is_within(a, bounds.a_lower, bounds.a_upper) ? 0 : MOTION) +
                      (is_within(tau, bounds.tau_lower, bounds.tau_upper) ? 0 : EFFORT);
    const int all = flags + (is_beyond() ? BEYOND : 0);
    found << all, 0;
    solve_if << (all ? LOOK : look_at_law(code[0], not_finite)), flags;
    return solve_if[0];
  }

 private:
  // The robot accelerates by a and the disturbance, which something else is known to cause; so
  // the bounds on a are moved by it. It makes a bound narrower by no more than the speed's barrier
  // permits at rest, so that a push that ends does no harm.
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
