// The tasks of a frame's orientation on SO(3), and of its pose.
//
// With y = log(R_dᵀ R), e = -y. The relative angular velocity in the frame's axes is
//
//   w̃ = Rᵀ(w - w_d),    y' = Jlog(y) w̃.
//
// w̃ = Jexp(y) y' gives w̃' = Jexp y'' + Jexp' y', and the motion of the desired frame adds the
// transport term:
//
//   w' = R w̃' - w × w_d + w_d'.
//
// The feedback says e'' = -Kv e' - Kp e, exactly, up to an angle of π.
#pragma once
#include <hsp/rotations.hpp>

#include "feedback.hpp"

namespace hsp {

// y and y' of a frame with the rotation R and the angular velocity w.
struct RelativeRotation {
  Matrix3 R;
  Vector3 w, y, y_dot;

  RelativeRotation(const FrameMotion<In>& frame, const OrientationSample<In>& desired)
      : R(frame.rotation), w(frame.velocity.tail<3>()) {
    const Matrix3 turned = desired.rotation.transpose() * R;
    const Vector3 w_tilde = R.transpose() * (w - desired.angular_velocity);
    y = log3(turned);
    y_dot = jlog3(y) * w_tilde;
  }

  // The angular acceleration w' that produces y''.
  Vector3 acceleration(const Vector3& y_ddot, const OrientationSample<In>& desired) const {
    const Vector3 w_d = desired.angular_velocity;
    const Vector3 w_tilde_dot = jexp3(y) * y_ddot + jexp3_dot(y, y_dot) * y_dot;
    return R * w_tilde_dot - w.cross(w_d) + desired.angular_acceleration;
  }
};

struct TrackOrientation {
  static constexpr const char* doc = "e = -log(R_dᵀ R) of a frame in the world.";
  FrameMotion<In> frame;
  OrientationSample<In> desired;
  Feedback<3> feedback;
  TaskSample<Out, 3> out;

  void operator()() {
    const RelativeRotation relative(frame, desired);
    out.jacobian = frame.jacobian.bottomRows<3>();
    out.jacobian_dot = frame.jacobian_dot.bottomRows<3>();
    out.error = -relative.y;
    out.error_rate = -relative.y_dot;
    Vector3 y_ddot = Vector3::Zero();
    feedback.add_to(y_ddot, out.error, out.error_rate);
    out.acceleration = relative.acceleration(y_ddot, desired);
  }
};

struct TrackPose {
  static constexpr const char* doc =
      "e = (x_d - x, -log(R_dᵀ R)) of a frame; gains may couple position and orientation.";
  FrameMotion<In> frame;
  PoseSample<In> desired;
  Feedback<6> feedback;
  TaskSample<Out, 6> out;

  void operator()() {
    const auto& [x_d, R_d] = desired;
    const RelativeRotation relative(frame, R_d);
    out.jacobian = frame.jacobian;
    out.jacobian_dot = frame.jacobian_dot;
    out.error << x_d.position - frame.position, -relative.y;
    out.error_rate << x_d.velocity - frame.velocity.head<3>(), -relative.y_dot;
    Eigen::Matrix<double, 6, 1> wanted;  // (x'', y'')
    wanted << x_d.acceleration, Vector3::Zero();
    feedback.add_to(wanted, out.error, out.error_rate);
    out.acceleration << wanted.head<3>(), relative.acceleration(wanted.tail<3>(), R_d);
  }
};

}  // namespace hsp
