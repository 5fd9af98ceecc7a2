// Uniformly accelerated motions from the last written state.
#pragma once
#include "orientations.hpp"

namespace hsp {

struct Extrapolation {
  static constexpr const char* doc = "x + x' Δt + ½ x'' Δt² with Δt = max(t - t0, 0).";
  In<1> start_time;   // t0
  In<3, 'd'> motion;  // x, x' and x'' then
  TrajectorySample<Out> out;

  void operator()(double t) {
    const double dt = std::max(t - start_time[0], 0.0);
    const auto x = motion.row(0).transpose(), x_dot = motion.row(1).transpose();
    const auto x_ddot = motion.row(2).transpose();
    out.position = x + dt * x_dot + 0.5 * dt * dt * x_ddot;
    out.velocity = x_dot + dt * x_ddot;
    out.acceleration = x_ddot;
  }
};

struct ExtrapolatedOrientation {
  static constexpr const char* doc = "R turned about ω + ½ ω' Δt, with Δt = max(t - t0, 0).";
  In<1> start_time;  // t0
  In<5, 3> motion;   // R, ω and ω' then
  OrientationSample<Out> out;

  void operator()(double t) {
    const double dt = std::max(t - start_time[0], 0.0);
    const Vector3 omega = motion.row(3).transpose(), omega_dot = motion.row(4).transpose();
    out.rotation = exp3(dt * (omega + 0.5 * dt * omega_dot)) * motion.topRows<3>();
    out.angular_velocity = omega + dt * omega_dot;
    out.angular_acceleration = omega_dot;
  }
};

}  // namespace hsp
