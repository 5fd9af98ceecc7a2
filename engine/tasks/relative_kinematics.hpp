// The kinematics of a frame relative to another one.
#pragma once
#include <hsp/records.hpp>
#include <hsp/rotations.hpp>

namespace hsp {

// Of frame f relative to frame r, in the axes of r. With d = p_f - p_r and K = J_f - J_r, whose
// linear rows also lose (angular rows of J_r) × d:
//
//   J = R_rᵀ K,    J' = R_rᵀ(K' - w_r × K)    since (R_rᵀ)' = -R_rᵀ[w_r]×.
//
// The rest of the velocity besides J v, where the frames move in their joints, is R_rᵀ y, with the
// rate R_rᵀ(y' - w_r × y): y = y_f - y_r, whose linear part also loses (angular part of y_r) × d.
struct RelativeKinematics {
  static constexpr const char* doc = "The motion of a frame relative to another, in its axes.";
  FrameMotion<In> frame, reference;
  FrameMotion<Out> out;
  Scratch<6, 'n'> K, K_dot;

  void operator()() {
    const Matrix3 R_r_T = reference.rotation.transpose();
    const Vector3 d = frame.position - reference.position;
    const Vector3 d_dot = frame.velocity.head<3>() - reference.velocity.head<3>();
    const Vector3 w_r = reference.velocity.tail<3>();
    const auto J_w = reference.jacobian.bottomRows<3>();
    const auto J_w_dot = reference.jacobian_dot.bottomRows<3>();

    K = frame.jacobian - reference.jacobian;
    K.topRows<3>() += skew(d).lazyProduct(J_w);
    K_dot = frame.jacobian_dot - reference.jacobian_dot;
    K_dot.topRows<3>() += skew(d).lazyProduct(J_w_dot) + skew(d_dot).lazyProduct(J_w);
    K_dot.topRows<3>() -= skew(w_r).lazyProduct(K.topRows<3>());
    K_dot.bottomRows<3>() -= skew(w_r).lazyProduct(K.bottomRows<3>());

    turn(R_r_T, K, out.jacobian);
    turn(R_r_T, K_dot, out.jacobian_dot);
    out.rotation = R_r_T * frame.rotation;
    out.position = R_r_T * d;
    out.velocity << R_r_T * (d_dot - w_r.cross(d)), R_r_T * (frame.velocity.tail<3>() - w_r);

    const Vector3 u = reference.own_velocity.tail<3>();
    const Vector3 u_dot = reference.own_acceleration.tail<3>();
    Vector6 y = frame.own_velocity - reference.own_velocity;
    Vector6 y_dot = frame.own_acceleration - reference.own_acceleration;
    y.head<3>() -= u.cross(d);
    y_dot.head<3>() -= u_dot.cross(d) + u.cross(d_dot) + w_r.cross(y.head<3>());
    y_dot.tail<3>() -= w_r.cross(y.tail<3>());
    turn(R_r_T, y, out.own_velocity);
    turn(R_r_T, y_dot, out.own_acceleration);
  }

 private:
  template <class X, class Y> static void turn(const Matrix3& R, const X& rows, Y& out) {
    out.template topRows<3>() = R.lazyProduct(rows.template topRows<3>());
    out.template bottomRows<3>() = R.lazyProduct(rows.template bottomRows<3>());
  }
};

}  // namespace hsp
