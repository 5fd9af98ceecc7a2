// The numbers that limits are made of, as calls read and write them.
#pragma once
#include <hsp/records.hpp>

namespace hsp {

// The limits that the barriers keep, margins included. jerk: how fast the acceleration may
// change, the effort's rate over the joint's largest inertia; bandwidth: α of the barriers.
template <template <int...> class As> struct MotionLimits {
  As<'n'> lower, upper, velocity, acceleration, jerk;
  As<1> bandwidth;
};

// Where a joint is beyond its limits, however it got there.
template <template <int...> class As> struct Ends {
  As<'n'> lower, upper, velocity;
};

// Bounds of one step on accelerations and on efforts.
template <template <int...> class As, template <int...> class Effort = As> struct Bounds {
  As<'n'> a_lower, a_upper;
  Effort<'n'> tau_lower, tau_upper;
};

// What a check of the limits found: 0 or 1 each.
template <template <int...> class As> struct LimitsOutcome {
  As<1> motion, effort;  // whether a bound on accelerations, on efforts is violated
  As<1> rows;            // whether a row of a barrier is, see BarrierRows
  As<1> violated;        // whether one of them is
  As<1> beyond;          // whether a joint is beyond its range, or faster than its limit
};

// What became of a QP.
template <template <int...> class As> struct QPOutcome {
  As<1> unsolved;  // 1: there is no result; 0
  As<1> status;    // that of the result, as `Status` in Python
};

// The errors of the acceleration that are known from efforts that were held, see `Held`.
template <template <int...> class As> struct Errors {
  As<'n'> error, least, most, lasting, steady;
};

// What was seen of the efforts that were held.
template <template <int...> class As> struct Held {
  As<2> timing;          // when the period that is observed ends, inf: none is; its length
  As<'n'> expected;      // velocity that is expected then
  As<'n'> stray;         // differences from it, summed over about 10 ms
  As<'n'> error;         // largest error of the acceleration of late
  As<'n'> drift, quick;  // mean error, and that of the last 30 ms
  As<'n'> least, most;   // the lowest that this mean was of late, 0 or less; the highest
  As<'n'> lasting;       // what that mean and that of the last hundredth of a second share
  As<'n'> steady;        // what drift and that of the last hundredth of a second share
  As<'n'> disturbance;   // acceleration that something else than the effort causes
};

}  // namespace hsp
