// Orientations that move: relative to others, from waypoint to waypoint, at a constant rate.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/rotations.hpp>

#include "smooth_step.hpp"

namespace hsp {

// Fixed-size values, for intermediate results of a call.
template <int... sizes> using Own = typename detail::Plain<double, Order::Rows, sizes...>::type;

// R = B exp(y) for an orientation B that moves:
//
//   ω  = ω_B + R w                 w = Jexp(y) y', the angular velocity relative to B in the
//   ω' = ω_B' + ω × R w + R w'     body's axes; w' = Jexp y'' + Jexp' y'
template <class B, class Y, class R> void turn_from(const B& base, const Y& y, R& out) {
  const Matrix3 J = jexp3(y.position), J_dot = jexp3_dot(y.position, y.velocity);
  const Vector3 w = J * y.velocity, w_dot = J * y.acceleration + J_dot * y.velocity;
  const Matrix3 R_now = base.rotation * exp3(y.position);
  const Vector3 turning = R_now * w;
  out.rotation = R_now;
  out.angular_velocity = base.angular_velocity + turning;
  out.angular_acceleration =
      base.angular_acceleration + out.angular_velocity.cross(turning) + R_now * w_dot;
}

struct OrientationPath {
  static constexpr const char* doc =
      "R(t) = exp(s a_i) R_i from t_i to t_{i+1}, s the smooth step; at rest at each R_i.";
  In<'m'> times;            // increasing, at least two
  In<'m', 3, 3> rotations;  // R_i
  In<'m', 3> turns;         // a_i in world axes, to the next waypoint; the last is not used
  OrientationSample<Out> out;

  void check() const { check_at_least("times", times.size(), 2); }
  void operator()(double t) {
    const Index last = times.size() - 1;
    Index i = 0;
    while (i < last - 1 && t >= times[i + 1]) ++i;
    const auto [s, s_dot, s_ddot] = smooth_step(t, times[i], times[i + 1] - times[i]);
    const Vector3 a = turns.row(i).transpose();
    if (s < 1.0) out.rotation = exp3(s * a) * rotations[i];
    else out.rotation = rotations[i + 1];  // exactly
    out.angular_velocity = s_dot * a;
    out.angular_acceleration = s_ddot * a;
  }
};

struct Spin {
  static constexpr const char* doc = "R(t) = exp(t ω) R0, ω in world axes.";
  In<3> angular_velocity;
  In<3, 3> start;
  OrientationSample<Out> out;

  void operator()(double t) {
    out.rotation = exp3(t * angular_velocity) * start;
    out.angular_velocity = angular_velocity;
    out.angular_acceleration.setZero();
  }
};

}  // namespace hsp
