// Motions of a pose.
#pragma once
#include "orientations.hpp"
#include "smooth_step.hpp"

namespace hsp {

struct Screw {
  static constexpr const char* doc =
      "exp(s a) R0 and p0 + V(s a) s b, s the smooth step: turn about an axis, and move along it.";
  double start_time, duration;
  In<2, 3> positions;     // p0 and p1
  In<2, 3, 3> rotations;  // R0 and R1
  In<3> a, b;             // V(a) b = p1 - p0
  PoseSample<Out> out;

  // (a, b) is the constant twist that moves the body from start to end in one second: a is the
  // rotation vector, b the velocity of the origin at the start. With f = exp(s a) b,
  //
  //   p' = s' f,   p'' = s'' f + s'² a × f,   ω = s' a,   ω' = s'' a.
  //
  // V(y) = Jexp(-y) is the left Jacobian of exp.
  void operator()(double t) {
    const auto [s, s_dot, s_ddot] = smooth_step(t, start_time, duration);
    const Matrix3 turn = exp3(s * a);
    const Vector3 f = turn * b;
    if (0.0 < s && s < 1.0) {
      out.position.position = positions.row(0).transpose() + s * jexp3(-s * a) * b;
      out.orientation.rotation = turn * rotations[0];
    } else {  // exactly
      out.position.position = positions.row(s < 1.0 ? 0 : 1).transpose();
      out.orientation.rotation = rotations[s < 1.0 ? 0 : 1];
    }
    out.position.velocity = s_dot * f;
    out.position.acceleration = s_ddot * f + s_dot * s_dot * a.cross(f);
    out.orientation.angular_velocity = s_dot * a;
    out.orientation.angular_acceleration = s_ddot * a;
  }
};

}  // namespace hsp
