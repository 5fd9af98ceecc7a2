// The parameters and results of limits, as records of calls.
#pragma once
#include <hsp/records.hpp>

namespace hsp {

// The limits that the barriers keep, margins included. jerk: maximum rate of the acceleration, the
// effort's rate over the joint's largest inertia; bandwidth: α of the barriers.
template <template <int...> class As> struct MotionLimits {
  As<'n'> lower, upper, velocity, acceleration, jerk;
  As<1> bandwidth;
};

// Limits beyond which a joint is reported, whatever the cause.
template <template <int...> class As> struct Ends {
  As<'n'> lower, upper, velocity;
};

// Bounds of one step on accelerations and on efforts.
template <template <int...> class As, template <int...> class Effort = As> struct Bounds {
  As<'n'> a_lower, a_upper;
  Effort<'n'> tau_lower, tau_upper;
};

// Results of a check of the limits: 0 or 1 each.
template <template <int...> class As> struct LimitsOutcome {
  As<1> motion, effort;  // whether a bound on accelerations, on efforts is violated
  As<1> rows;            // whether a row of a barrier is, see BarrierRows
  As<1> violated;        // whether one of them is
  As<1> beyond;          // whether a joint is beyond its range, or faster than its limit
};

// The outcome of a QP.
template <template <int...> class As> struct QPOutcome {
  As<1> unsolved;  // 1: there is no result; 0
  As<1> status;    // that of the result, as `Status` in Python
};

// Errors of the acceleration, known from earlier efforts, see `Held`.
template <template <int...> class As> struct Errors {
  As<'n'> error, least, most, lasting, steady;
};

// Observations of the effects of earlier efforts.
template <template <int...> class As> struct Held {
  As<2> timing;          // end of the observed period, inf: none; its length
  As<'n'> expected;      // velocity that is expected then
  As<'n'> stray;         // differences from it, summed over about 10 ms
  As<'n'> error;         // largest recent error of the acceleration
  As<'n'> drift, quick;  // mean error, and that of the last 30 ms
  As<'n'> least, most;   // lowest recent value of this mean, 0 or less; the highest
  As<'n'> lasting;       // common part of that mean and the mean of the last 10 ms
  As<'n'> steady;        // common part of drift and the mean of the last 10 ms
  As<'n'> disturbance;   // acceleration by other causes than the effort
};

}  // namespace hsp
