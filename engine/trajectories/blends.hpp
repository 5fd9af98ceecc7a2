// Smooth changes from one motion to another, of a point or an orientation.
#pragma once
#include "orientations.hpp"
#include "polynomials.hpp"
#include "smooth_step.hpp"

namespace hsp {

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
      out.position = desired.position;
      out.velocity = desired.velocity;
      out.acceleration = desired.acceleration;
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
      "x(t) = (1 - s) x_0(t) + s x_1(t), s the smooth step, in the place of x_1.";
  double start_time, duration;
  TrajectorySample<In> before;
  TrajectorySample<InOut> after;

  void operator()(double t) { mix(smooth_step(t, start_time, duration), before, after, after); }
};

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
    if (elapsed < 0.0) {
      out.rotation = start;
      out.angular_velocity.setZero();
      out.angular_acceleration.setZero();
    } else if (elapsed >= duration) {
      out.rotation = desired.rotation;
      out.angular_velocity = desired.angular_velocity;
      out.angular_acceleration = desired.angular_acceleration;
    } else {
      TrajectorySample<Own, 3> y;
      polynomial(elapsed / duration, duration, coefficients, y);
      turn_from(desired, y, out);
    }
  }
};

}  // namespace hsp
