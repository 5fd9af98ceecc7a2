// Smooth changes from one motion to another, of a point or an orientation.
#pragma once
#include "../src/plan.hpp"
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

// The mixture of two points, a time after it began.
inline void crossfade(double elapsed, double duration, const TrajectorySample<In>& before,
                      const TrajectorySample<In>& after, TrajectorySample<Out>& out) {
  if (elapsed < 0.0) {
    assign(before, out);
    return;
  }
  const SmoothStep step =
      elapsed < duration ? smooth_step(elapsed, 0.0, duration) : SmoothStep{1.0, 0.0, 0.0};
  if (step.over()) assign(after, out);  // exactly
  else mix(step, before, after, out);
}

struct Crossfade {
  static constexpr const char* doc =
      "x(t) = (1 - s) x_0(t) + s x_1(t), s the smooth step; exactly x_0 before t0, x_1 afterwards.";
  double start_time, duration;
  TrajectorySample<In> before, after;
  TrajectorySample<Out> out;

  void operator()(double t) { crossfade(t - start_time, duration, before, after, out); }
};

struct CrossfadeOfStreams {
  static constexpr const char* doc =
      "As Crossfade, where x_0 is computed until t0 + T only, and x_1 from t0 on: a stream begins "
      "when it is followed, and forgets.";
  double start_time, duration;
  Shared<Plan> compute_before, compute_after;
  TrajectorySample<In> before, after;  // which they write
  TrajectorySample<Out> out;

  void operator()(double t) {
    const double elapsed = t - start_time;
    if (elapsed < duration) compute_before->run(t);
    if (elapsed >= 0.0) compute_after->run(t);
    crossfade(elapsed, duration, before, after, out);
  }
};

// R_d exp(y), y a polynomial of the time since it began over T; exactly R_d from T on.
template <class Coefficients>
void turn_into(const OrientationSample<In>& desired, const Coefficients& coefficients,
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

// The coefficients of y, a quintic of the time since it began over T that ends in zero with its
// first two derivatives: R_d exp(y) begins with R, ω and ω' of a start. w = Jexp(y) y' is the
// angular velocity relative to R_d in the body's axes.
template <class Start, class Desired, class Coefficients>
void offset_coefficients(const Start& start, const Desired& desired, double T,
                         Coefficients& coefficients) {
  const Matrix3 R = start.rotation, R_d = desired.rotation;
  const Vector3 omega = start.angular_velocity, omega_d = desired.angular_velocity;
  const Vector3 w = R.transpose() * (omega - omega_d);
  const Vector3 change = start.angular_acceleration - desired.angular_acceleration;
  const Vector3 w_dot = R.transpose() * (change - omega.cross(R * w));
  const Vector3 y = log3(R_d.transpose() * R);
  const Matrix3 inverse = jlog3(y);
  const Vector3 y_dot = inverse * w;
  const Vector3 y_ddot = inverse * (w_dot - jexp3_dot(y, y_dot) * y_dot);
  const Vector3 v = T * y_dot, a = T * T * y_ddot;
  coefficients.row(0) = y.transpose();
  coefficients.row(1) = v.transpose();
  coefficients.row(2) = (0.5 * a).transpose();
  coefficients.row(3) = (-10.0 * y - 6.0 * v - 1.5 * a).transpose();
  coefficients.row(4) = (15.0 * y + 8.0 * v + 1.5 * a).transpose();
  coefficients.row(5) = (-6.0 * y - 3.0 * v - 0.5 * a).transpose();
}

struct OffsetCoefficients {
  static constexpr const char* doc =
      "The coefficients of y: R_d exp(y) begins with R, ω and ω' of a start, and y ends in zero.";
  OrientationSample<In> start, desired;
  double duration;
  Out<6, 3> coefficients;

  void operator()() { offset_coefficients(start, desired, duration, coefficients); }
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

struct CrossfadeOrientationOfStreams {
  static constexpr const char* doc =
      "As CrossfadeOrientation, where R_0 is computed until t0 only, and R_1 from t0 on: there y "
      "is found, in the first call.";
  double start_time, duration;
  Shared<Plan> compute_before, compute_after;
  OrientationSample<In> before, after;  // which they write
  InOut<6, 3> coefficients;             // of y
  InOutInts<1> found;                   // whether they are
  OrientationSample<Out> out;

  void operator()(double t) {
    const double elapsed = t - start_time;
    if (elapsed < 0.0) {
      compute_before->run(t);
      assign(before, out);
      return;
    }
    if (elapsed < duration && !found[0]) {
      compute_before->run(start_time);
      compute_after->run(start_time);
      offset_coefficients(before, after, duration, coefficients);
      found[0] = 1;
    }
    compute_after->run(t);
    turn_into(after, coefficients, elapsed, duration, out);
  }
};

}  // namespace hsp
