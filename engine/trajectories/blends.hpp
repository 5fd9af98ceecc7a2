// Smooth changes from one motion to another, of a point or an orientation.
#pragma once
#include "orientations.hpp"
#include "polynomials.hpp"
#include "smooth_step.hpp"

namespace hsp {

inline void assign(const TrajectorySample<In>& from, TrajectorySample<Out>& out) {
  out.position = from.position;
  out.velocity = from.velocity;
  out.acceleration = from.acceleration;
}

inline void assign(const OrientationSample<In>& from, OrientationSample<Out>& out) {
  out.rotation = from.rotation;
  out.angular_velocity = from.angular_velocity;
  out.angular_acceleration = from.angular_acceleration;
}

struct Blend {
  static constexpr const char* doc =
      "x(t) = (1 - s) (x0 + (t - t0) v0) + s x_d(t), s the smooth step; x0 before t0.";
  double start_time, duration;
  In<2, 'd'> start;  // x0 and v0
  TrajectorySample<In> desired;
  TrajectorySample<Out> out;

  void operator()(double t) {
    const double elapsed = t - start_time;
    if (elapsed >= duration) {  // exactly
      assign(desired, out);
      return;
    }
    out.position = start.row(0).transpose();
    out.velocity.setZero();
    out.acceleration.setZero();
    if (elapsed < 0.0) return;
    out.velocity = start.row(1).transpose();
    out.position += elapsed * out.velocity;
    mix(smooth_step(elapsed, 0.0, duration), out, desired, out);
  }
};

struct Crossfade {
  static constexpr const char* doc =
      "x(t) = (1 - s) x_0(t) + s x_1(t), s the smooth step; exactly x_0 before t0, x_1 afterwards.";
  double start_time, duration;
  TrajectorySample<In> before, after;
  TrajectorySample<Out> out;

  void operator()(double t) {
    const double elapsed = t - start_time;
    if (elapsed < 0.0) {
      assign(before, out);
      return;
    }
    const SmoothStep step =
        elapsed < duration ? smooth_step(elapsed, 0.0, duration) : SmoothStep{1.0, 0.0, 0.0};
    if (step.s == 1.0) assign(after, out);  // exactly
    else mix(step, before, after, out);
  }
};

// R_d exp(y), y a polynomial of the time since it began over T; exactly R_d from T on.
inline void turn_into(const OrientationSample<In>& desired, const In<6, 3>& coefficients,
                      double elapsed, double duration, OrientationSample<Out>& out) {
  if (elapsed >= duration) {
    assign(desired, out);
    return;
  }
  TrajectorySample<Own, 3> y;
  polynomial(elapsed / duration, duration, coefficients, y);
  turn_from(desired, y, out);
}

struct BlendOrientation {
  static constexpr const char* doc =
      "R(t) = R_d(t) exp(y(t)), y a polynomial of (t - t0)/T; R0 before t0, R_d from t0 + T on.";
  double start_time, duration;
  In<3, 3> start;         // R0
  In<6, 3> coefficients;  // of y
  OrientationSample<In> desired;
  OrientationSample<Out> out;

  void operator()(double t) {
    const double elapsed = t - start_time;
    if (elapsed >= 0.0) {
      turn_into(desired, coefficients, elapsed, duration, out);
      return;
    }
    out.rotation = start;
    out.angular_velocity.setZero();
    out.angular_acceleration.setZero();
  }
};

struct CrossfadeOrientation {
  static constexpr const char* doc =
      "R(t) = R_1(t) exp(y(t)), y a polynomial of (t - t0)/T; R_0(t) before t0, R_1 from t0 + T "
      "on.";
  double start_time, duration;
  OrientationSample<In> before;
  In<6, 3> coefficients;  // of y
  OrientationSample<In> after;
  OrientationSample<Out> out;

  void operator()(double t) {
    const double elapsed = t - start_time;
    if (elapsed < 0.0) assign(before, out);
    else turn_into(after, coefficients, elapsed, duration, out);
  }
};

}  // namespace hsp
