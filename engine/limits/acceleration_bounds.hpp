// Position, velocity and acceleration limits as bounds on the acceleration.
//
// With the bandwidth α a position barrier h(q) ≥ 0 is kept by h'' + 2α h' + α² h ≥ 0, and a speed
// limit by v' ≤ 2α (v_max - v). Where barriers contradict each other, position has priority over
// velocity, and velocity over acceleration: each narrows the range of the earlier ones as far as
// possible.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/indices.hpp>
#include <limits>

#include "records.hpp"

namespace hsp {

struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();

  // Its intersection with another range, or its nearest point.
  Range within(const Range& other) const {
    return {std::max(low, std::min(other.low, high)), std::min(high, std::max(other.high, low))};
  }
};

namespace barriers {

// Factor of the velocity barrier's slope beyond the guarded speed.
constexpr double steeper = 4.0;

// Maximum share of a joint's range that a mean error may remove at one end: the error of a blocked
// joint is its whole commanded acceleration.
constexpr double most_shift = 0.1;

// Time [s] whose change of effort is reserved against a lasting force, if that is more: a light
// wrist with an undeclared tool.
constexpr double held_time = 0.002;

// The accelerations that a position limit permits.
//
// A mean error would pass the limit by the error over α². So the barrier compensates the worst
// recent mean towards it, `least` at the lower end and `most` at the upper one, up to `shift`, and
// the present `lasting` error, up to what a jerk of `held_time` changes.
template <class Held>
Range of_position(Index i, double q, double v, const MotionLimits<In>& limits, const Held& held) {
  const double alpha = limits.bandwidth[0], lower = limits.lower[i], upper = limits.upper[i];
  const double damping = 2.0 * alpha * v;
  const double shift = most_shift * alpha * alpha * (upper - lower);
  const double most_lasting = std::max(shift, held_time * limits.jerk[i]);
  Range range = {-alpha * alpha * (q - lower) - damping, alpha * alpha * (upper - q) - damping};
  range.low += std::max(std::min(-held.least[i], shift), std::min(-held.lasting[i], most_lasting));
  range.high -= std::max(std::min(held.most[i], shift), std::min(held.lasting[i], most_lasting));
  range.low -= std::max(held.steady[i], 0.0);
  range.high -= std::min(held.steady[i], 0.0);
  return range;
}

// The largest acceleration towards a speed limit at a distance.
//
// It is 2α gap, or √(jerk gap) if that is less: then the acceleration vanishes at the limit with
// half the jerk, and the rest of the effort's rate is reserved for the coupling of other joints.
inline double towards_speed(double gap, double alpha, double jerk) {
  const double barrier = 2.0 * alpha * gap;
  return gap > 0.0 && jerk < std::numeric_limits<double>::infinity()
             ? std::min(barrier, std::sqrt(jerk * gap))
             : barrier;
}

// The accelerations that a speed limit permits. Its margin covers the largest recent error of the
// acceleration, up to half the speed.
template <class Held>
Range of_speed(Index i, double v, const MotionLimits<In>& limits, const Held& held) {
  const double alpha = limits.bandwidth[0], jerk = limits.jerk[i], most = limits.velocity[i];
  const double speed = std::max(most - held.error[i] / (2.0 * alpha * steeper), 0.5 * most);
  double rising = towards_speed(speed - v, alpha, jerk) - std::min(held.steady[i], 0.0);
  double slowing = -towards_speed(speed + v, alpha, jerk) - std::max(held.steady[i], 0.0);
  if (slowing > 0.0) {
    slowing *= steeper;
    rising = std::max(rising, slowing);
  }
  if (rising < 0.0) {
    rising *= steeper;
    slowing = std::min(slowing, rising);
  }
  return {slowing, rising};
}

}  // namespace barriers

// Write the bounds on the acceleration that the barriers of `Limits` require. `where` is the index
// in q of each dof's coordinate, -1 for none.
//
// A constant external force uses effort without motion, so the barriers are widened by
// `held.steady`, the still present part of a longer mean of the error.
template <class Held>
void write_acceleration_bounds(const In<'q'>& q, const In<'n'>& v, const Ints<'n'>& where,
                               const MotionLimits<In>& limits, const Held& held, Out<'n'>& a_lower,
                               Out<'n'>& a_upper) {
  for (Index i = 0; i < v.size(); ++i) {
    Range range;
    if (where[i] >= 0) range = barriers::of_position(i, q[where[i]], v[i], limits, held);
    range = range.within(barriers::of_speed(i, v[i], limits, held));
    range = range.within({-limits.acceleration[i], limits.acceleration[i]});
    a_lower[i] = range.low;
    a_upper[i] = range.high;
  }
}

struct AccelerationBounds {
  static constexpr const char* doc =
      "The accelerations that position, velocity and acceleration limits permit.";
  In<'q'> q;
  In<'n'> v;
  Ints<'n'> where;
  MotionLimits<In> limits;
  Errors<In> held;
  Out<'n'> a_lower, a_upper;

  void check() const { check_indices("where", where, q.size(), -1); }
  void operator()() { write_acceleration_bounds(q, v, where, limits, held, a_lower, a_upper); }
};

// Whether lower ≤ x ≤ upper, each component.
template <class X, class Bound> bool is_within(const X& x, const Bound& lower, const Bound& upper) {
  return (lower.array() <= x.array()).all() && (x.array() <= upper.array()).all();
}

struct Within {
  static constexpr const char* doc = "Whether lower ≤ x ≤ upper, each component.";
  In<'n'> x, lower, upper;

  bool operator()() { return is_within(x, lower, upper); }
};

}  // namespace hsp
