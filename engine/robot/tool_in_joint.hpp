// The placement of a tool in the joint that carries it.
#pragma once
#include <hsp/records.hpp>

namespace hsp {

// A frame's motion in the joint that carries it, in the axes of the joint.
template <template <int...> class As> struct LocalMotion {
  As<3, 3> R_local;
  As<3> p_local, p_local_dot, p_local_ddot;
  As<3> w_local, w_local_dot;
};

struct ToolInJoint {
  static constexpr const char* doc =
      "The motion of a frame in its joint, from a pose in the axes that the frame has in the "
      "model.";
  In<3, 3> rotation;  // of these axes in the joint
  In<3> position;     // of their origin
  PoseSample<In> pose;
  LocalMotion<Out> out;

  void operator()() {
    const Matrix3 R = rotation;
    const auto& [at, turned] = pose;
    out.R_local = R * turned.rotation;
    out.p_local = position + R * at.position;
    out.p_local_dot = R * at.velocity;
    out.p_local_ddot = R * at.acceleration;
    out.w_local = R * turned.angular_velocity;
    out.w_local_dot = R * turned.angular_acceleration;
  }
};

}  // namespace hsp
