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
// The feedback sets e'' = -Kv e' - Kp e, exactly, up to an angle of π. The joints produce these
// accelerations minus the frame's own motion in its joint; see FrameMotion.
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
    out.acceleration -= frame.own_acceleration.tail<3>();
  }
};

// The position rows of a pose are along the axes of the world, or turn with the desired frame. With
// ε = x_d - x in the world and e = R_dᵀ ε,
//
//   e' = R_dᵀ (ε' - w_d × ε),    e'' = R_dᵀ (ε'' - 2 w_d × ε' - w_d' × ε + w_d × (w_d × ε)),
//
// J = R_dᵀ J_x and J v = R_dᵀ x', but for the frame's own motion in its joint.
struct TrackPose {
  static constexpr const char* doc =
      "e = (x_d - x, -log(R_dᵀ R)) of a frame; gains may couple position and orientation.";
  FrameMotion<In> frame;
  PoseSample<In> desired;
  bool turning;  // whether the position rows are along the axes of the desired frame
  Feedback<6> feedback;
  TaskSample<Out, 6> out;

  void operator()() {
    const auto& [x_d, R_d] = desired;
    const RelativeRotation relative(frame, R_d);
    const Vector3 x_dot = frame.velocity.head<3>(), own = frame.own_velocity.head<3>();
    const Vector3 away = x_d.position - frame.position, rate = x_d.velocity - x_dot;
    const Vector3 w_d = R_d.angular_velocity;
    out.jacobian = frame.jacobian;
    out.jacobian_dot = frame.jacobian_dot;
    out.error << away, -relative.y;
    out.error_rate << rate, -relative.y_dot;
    if (turning) turn(frame.jacobian.topRows<3>(), away, rate);

    Vector6 wanted = Vector6::Zero();  // -e''
    feedback.add_to(wanted, out.error, out.error_rate);
    const Vector3 own_dot = frame.own_acceleration.head<3>();
    Vector3 x_ddot = x_d.acceleration + wanted.head<3>() - own_dot;
    if (turning) {
      x_ddot = x_d.acceleration + R_d.rotation * wanted.head<3>() - own_dot;
      x_ddot += w_d.cross(w_d.cross(away)) - 2.0 * w_d.cross(rate);
      x_ddot -= R_d.angular_acceleration.cross(away);
      // (R_dᵀ J_x v)'
      x_ddot = R_d.rotation.transpose() * (x_ddot - w_d.cross(x_dot - own)).eval();
    }
    out.acceleration << x_ddot, relative.acceleration(wanted.tail<3>(), R_d);
    out.acceleration.tail<3>() -= frame.own_acceleration.tail<3>();
  }

 private:
  template <class J> void turn(const J& jacobian, const Vector3& away, const Vector3& rate) {
    const Vector3 w_d = desired.orientation.angular_velocity;
    const Matrix3 R_T = desired.orientation.rotation.transpose(), R_T_dot = -R_T * skew(w_d);
    auto J_dot = out.jacobian_dot.template topRows<3>();
    for (Index k = 0; k < jacobian.cols(); ++k) {
      const Vector3 column = jacobian.col(k), rate_of_column = J_dot.col(k);
      out.jacobian.col(k).template head<3>() = R_T * column;
      J_dot.col(k) = R_T * rate_of_column + R_T_dot * column;
    }
    out.error.template head<3>() = R_T * away;
    out.error_rate.template head<3>() = R_T * (rate - w_d.cross(away));
  }
};

}  // namespace hsp
