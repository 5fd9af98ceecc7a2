// Placement, Jacobian and motion of a frame that a joint carries.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/records.hpp>

namespace hsp {

// The joint that carries a frame; see JointJacobians.
struct ParentJoint {
  Columns<6, 'x'> J_world, J_world_dot;  // of all joints, at the world's origin
  Columns<3, 3> R_joint;                 // world ← joint
  In<3> p_joint;
  In<3, 3> R_local;                          // joint ← frame
  In<3> p_local, p_local_dot, p_local_ddot;  // r, r' and r'': the frame's origin in the joint
  In<3> w_local, w_local_dot;                // its angular velocity in the joint, and the rate
  Ints<'c'> columns, dofs;  // columns of J_world that move the joint, and their indices in v

  void check() const { check_indices("columns", columns, J_world.cols()); }
};

// In world axes. A column (l, w) of the Jacobian at the world's origin is
//
//   (l + w × p, w)              at the frame's origin p, and its rate is
//   (l' + w' × p + w × p', w').
//
// A frame that moves in its joint has a velocity in excess of J v. With ω of the joint, R r' and R
// w, and their rates, in which p' is that of the frame, so that J'v has the other half of Coriolis'
// term:
//
//   ω × R r' + R r'',    ω × R w + R w'.
//
// Only joints that carry the frame have columns. Those of mimic joints are added to their
// leader's.
struct FrameKinematics {
  static constexpr const char* doc =
      "J, J', R, p and the velocity of a frame, unless computed already.";
  Ints<1> stamp;
  InOutInts<1> computed;  // the stamp of the last computation
  ParentJoint carrier;
  In<'n'> v;
  FrameMotion<Out> motion;
  Out<6> drift;  // the acceleration for v' = 0

  void check() const { check_indices("dofs", carrier.dofs, v.size()); }
  void operator()() {
    if (computed[0] == stamp[0]) return;
    computed[0] = stamp[0];
    const auto& [J_world, J_world_dot, R_joint, p_joint, R_local, r, r_dot, r_ddot, w_local,
                 w_local_dot, columns, dofs] = carrier;
    const Vector3 p = p_joint + R_joint * r;
    motion.position = p;
    motion.rotation.noalias() = R_joint * R_local;

    motion.jacobian.setZero();
    Vector3 p_dot = Vector3::Zero(), omega = Vector3::Zero();
    for (Index k = 0; k < columns.size(); ++k) {
      const Index c = columns[k], j = dofs[k];
      const Vector3 l = J_world.col(c).head<3>(), w = J_world.col(c).tail<3>();
      const Vector3 linear = l + w.cross(p);
      motion.jacobian.col(j).head<3>() += linear;
      motion.jacobian.col(j).tail<3>() += w;
      p_dot += v[j] * linear;
      omega += v[j] * w;
    }
    const Vector3 own = R_joint * r_dot, own_omega = R_joint * w_local;
    motion.own_velocity << own, own_omega;
    motion.own_acceleration << omega.cross(own) + R_joint * r_ddot,
        omega.cross(own_omega) + R_joint * w_local_dot;
    p_dot += own;
    omega += own_omega;
    motion.velocity << p_dot, omega;

    motion.jacobian_dot.setZero();
    Vector3 p_ddot = Vector3::Zero(), omega_dot = Vector3::Zero();  // for v' = 0
    for (Index k = 0; k < columns.size(); ++k) {
      const Index c = columns[k], j = dofs[k];
      const Vector3 l_dot = J_world_dot.col(c).head<3>(), w_dot = J_world_dot.col(c).tail<3>();
      const Vector3 w = J_world.col(c).tail<3>();
      const Vector3 linear = l_dot + w_dot.cross(p) + w.cross(p_dot);
      motion.jacobian_dot.col(j).head<3>() += linear;
      motion.jacobian_dot.col(j).tail<3>() += w_dot;
      p_ddot += v[j] * linear;
      omega_dot += v[j] * w_dot;
    }
    drift << p_ddot, omega_dot;
    drift += motion.own_acceleration;
  }
};

}  // namespace hsp
