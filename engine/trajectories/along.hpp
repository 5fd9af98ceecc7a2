// A path at a speed: x(t) = p(s(t)), s the length along the path.
//
//   x' = p' s'      x'' = p' s'' + p'' s'²      p' and p'' by s
//
// The path is itself a motion, with a parameter u that is not its length. The length from the
// path's start, s(u), is a polynomial in each cell of a table, and u(s) is found by Newton's
// method.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/indices.hpp>

#include "../src/plan.hpp"
#include "orientations.hpp"

namespace hsp {

// s(t): the speed rises from 0, is constant, and falls to 0, on ramps v (3 u² - 2 u³), u = τ/T,
// whose s'' is zero at both ends and 1.5 v/T in the middle. s is C²; without ramps (T = 0) the
// speed jumps at both ends.
struct TimeScaling {
  double start_time, speed, ramp;
  double length;  // of the path; infinite where it goes on for ever

  struct Value {
    double s, s_dot, s_ddot;
  };
  Value operator()(double t) const {
    const double tau = t - start_time, duration = ramp + length / speed;
    if (ramp == 0.0 && std::isinf(length)) return {speed * tau, speed, 0.0};
    if (tau <= 0.0) return {0.0, 0.0, 0.0};
    if (tau >= duration) return {length, 0.0, 0.0};
    if (tau < ramp) return rise(tau);
    if (tau <= duration - ramp) return {speed * (tau - 0.5 * ramp), speed, 0.0};
    const auto [s, s_dot, s_ddot] = rise(duration - tau);  // the fall is its mirror image
    return {length - s, s_dot, -s_ddot};
  }

 private:
  Value rise(double tau) const {
    const double u = tau / ramp;
    return {speed * ramp * u * u * u * (1.0 - 0.5 * u), speed * u * u * (3.0 - 2.0 * u),
            6.0 * speed * u * (1.0 - u) / ramp};
  }
};

// The length s(u) along a path: lengths[i] + Σ_k c_ik w^k from knots[i] to knots[i + 1], where w
// goes from -1 to 1. `repeats`: beyond the last knot the same lengths follow again, for ever.
struct ArcLength {
  In<'k'> knots, lengths;
  In<'c', 'p'> coefficients;  // one cell less than knots
  bool repeats;

  void check() const {
    check_at_least("knots", knots.size(), 2);
    check_at_least("coefficients", coefficients.rows(), knots.size() - 1);
    check_at_least("the coefficients of a cell", coefficients.cols(), 1);
  }
  // u(s)
  double parameter(double s) const {
    const Index last = knots.size() - 1;
    double turns = 0.0;
    if (repeats) {
      turns = std::floor(s / lengths[last]);
      s -= turns * lengths[last];
    }
    const double before = turns * (knots[last] - knots[0]);
    if (s <= 0.0) return before + knots[0];
    if (s >= lengths[last]) return before + knots[last];
    const double* after = std::upper_bound(lengths.data() + 1, lengths.data() + last, s);
    const Index i = after - lengths.data() - 1;
    const double w = in_cell(i, s - lengths[i], lengths[i + 1] - lengths[i]);
    return before + 0.5 * ((1.0 - w) * knots[i] + (1.0 + w) * knots[i + 1]);
  }

 private:
  // The w at which Σ_k c_ik w^k = s: Newton's method, or bisection where it leaves the bracket,
  // as it may where the path's own motion begins at rest. It ends where the length is met but for
  // rounding, or where the next correction would be the square of a small one.
  double in_cell(Index i, double s, double length) const {
    const auto c = coefficients.row(i);
    double low = -1.0, high = 1.0, w = 2.0 * s / length - 1.0;
    for (int round = 0; round < 100; ++round) {
      double excess = 0.0, slope = 0.0;
      for (Index k = c.size() - 1; k >= 0; --k) {
        slope = slope * w + excess;
        excess = excess * w + c[k];
      }
      excess -= s;
      if (std::abs(excess) <= 2e-16 * length) return w;
      (excess > 0.0 ? high : low) = w;
      const double newton = w - excess / slope;
      const double next = low < newton && newton < high ? newton : 0.5 * (low + high);
      if (std::abs(next - w) <= 1e-12) return next;
      w = next;
    }
    return w;
  }
};

// Conversion of the path's own rates y and y_u, by u, to those by t. With g the rate of the
// length by u, c = y/g is the rate by s:
//
//   y' = c s'      y'' = c s'' + (y_u - c g_u)/g² s'²
class ByLength {
 public:
  // `rate` and `change`: y and y_u of the measured motion, g = |rate|.
  template <class Rate, class Change>
  ByLength(const TimeScaling::Value& scaling, const Rate& rate, const Change& change)
      : scaling_(scaling), g_(rate.norm()), g_u_(g_ > 0.0 ? rate.dot(change) / g_ : 0.0) {}

  template <class Y, class YU, class YDot, class YDDot>
  void operator()(const Y& y, const YU& y_u, YDot& y_dot, YDDot& y_ddot) const {
    if (!(g_ > 0.0)) {  // the path's own motion is at rest; so is this one, at an end
      y_dot.setZero();
      y_ddot.setZero();
      return;
    }
    const auto [s, s_dot, s_ddot] = scaling_;
    y_dot = (s_dot / g_) * y;
    y_ddot = (s_ddot / g_) * y + (s_dot / g_) * (s_dot / g_) * (y_u - (g_u_ / g_) * y);
  }

 private:
  TimeScaling::Value scaling_;
  double g_, g_u_;
};

struct Along {
  static constexpr const char* doc = "x(t) = p(s(t)), s the length along the path of a motion.";
  Shared<Plan> path;  // writes `own` at a parameter u
  TrajectorySample<In> own;
  ArcLength arc;
  TimeScaling scaling;
  TrajectorySample<Out> out;

  void operator()(double t) {
    const TimeScaling::Value now = scaling(t);
    path->run(arc.parameter(now.s));
    out.position = own.position;
    const ByLength by_length(now, own.velocity, own.acceleration);
    by_length(own.velocity, own.acceleration, out.velocity, out.acceleration);
  }
};

struct AlongOrientation {
  static constexpr const char* doc =
      "R(t) = P(s(t)), s the angle [rad] through which a motion has turned.";
  Shared<Plan> path;
  OrientationSample<In> own;
  ArcLength arc;
  TimeScaling scaling;
  OrientationSample<Out> out;

  void operator()(double t) {
    const TimeScaling::Value now = scaling(t);
    path->run(arc.parameter(now.s));
    out.rotation = own.rotation;
    const ByLength by_angle(now, own.angular_velocity, own.angular_acceleration);
    by_angle(own.angular_velocity, own.angular_acceleration, out.angular_velocity,
             out.angular_acceleration);
  }
};

struct AlongPose {
  static constexpr const char* doc =
      "M(t) = P(s(t)), s the length along the path of a motion's origin, or its angle [rad].";
  Shared<Plan> path;
  PoseSample<In> own;
  ArcLength arc;
  TimeScaling scaling;
  bool by_angle;  // if the origin does not move
  PoseSample<Out> out;

  void operator()(double t) {
    const TimeScaling::Value now = scaling(t);
    path->run(arc.parameter(now.s));
    const auto& x = own.position;
    const auto& R = own.orientation;
    const ByLength by_length = by_angle ? ByLength(now, R.angular_velocity, R.angular_acceleration)
                                        : ByLength(now, x.velocity, x.acceleration);
    out.position.position = x.position;
    by_length(x.velocity, x.acceleration, out.position.velocity, out.position.acceleration);
    out.orientation.rotation = R.rotation;
    by_length(R.angular_velocity, R.angular_acceleration, out.orientation.angular_velocity,
              out.orientation.angular_acceleration);
  }
};

}  // namespace hsp
