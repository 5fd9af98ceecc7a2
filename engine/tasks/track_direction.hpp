// The task of an axis of a frame that points along a direction.
//
// With m the axis in the world, n = R_dᵀ m and n' = R_dᵀ((w - w_d) × m). The stereographic
// coordinates y = n_xy/s, s = 1 + n_z, are conformal: y' = Q n'/s, where Q v = v_xy - n_xy v_z/s
// is an isometry of the tangent plane at n. Hence y'' = u needs the acceleration of n along the
// sphere
//
//   s Qᵀu + 2 (s'/s) n' - (|n'|²/s) ẑ,   ẑ the part of z perpendicular to n,
//
// where s Qᵀu = -Qᵀ(Kv Q n' + Kp n_xy) for u = -Kv y' - Kp y. Only the terms of second order in
// n' grow towards the antipode; they are kept bounded.
#pragma once
#include <cmath>
#include <hsp/rotations.hpp>

#include "feedback.hpp"

namespace hsp {

using Vector2 = Eigen::Vector2d;

// Smallest 1 + cos(angle) of the coordinates; below it (angle > 168°) they are held.
constexpr double antipode_margin = 0.02;

// The unit vector along n_xy, or (1, 0) if n_xy is zero.
inline Vector2 horizontal(const Vector3& n) {
  const double length = n.head<2>().norm();
  return length == 0.0 ? Vector2::UnitX() : Vector2(n.head<2>() / length);
}

// n_xy/(1 + n_z), with 1 + n_z at least the margin.
inline Vector2 stereographic(const Vector3& n) {
  if (1.0 + n[2] >= antipode_margin) return n.head<2>() / (1.0 + n[2]);
  return std::sqrt(2.0 / antipode_margin - 1.0) * horizontal(n);
}

// Q v = v_xy - n_xy v_z/(1 + n_z) for v perpendicular to the unit vector n. For n_z ≤ -0.5, where
// digits would cancel, v_z comes from v · n = 0: Q is then a reflection of v_xy, stretched along
// n_xy.
inline Vector2 flattened(const Vector3& n, const Vector3& v) {
  const Vector2 v_xy = v.head<2>();
  if (n[2] > -0.5) return v_xy - v[2] / (1.0 + n[2]) * n.head<2>();
  const Vector2 along = horizontal(n);
  return v_xy + along.dot(v_xy) * (1.0 - n[2]) / n[2] * along;
}

struct TrackDirection {
  static constexpr const char* doc =
      "e = -(n_x, n_y)/(1 + n_z), the direction n of an axis in the desired frame.";
  In<3> axis;        // in the frame, of length 1
  In<2, 3> normals;  // across it, right-handed with it
  FrameMotion<In> frame;
  OrientationSample<In> desired;
  Feedback<2> feedback;
  TaskSample<Out, 2> out;

  void operator()() {
    const Matrix3 R = frame.rotation, R_d = desired.rotation;
    const Vector3 w = frame.velocity.tail<3>(), w_d = desired.angular_velocity;
    const Vector3 w_d_dot = desired.angular_acceleration;
    const Vector3 m = R * axis;
    const Eigen::Matrix<double, 2, 3> c = normals * R.transpose();
    const Eigen::Matrix<double, 2, 3> c_dot = -c * skew(w);  // the rows w × c

    // J = c J_w, J' = c J_w' + c' J_w.
    const auto J_w = frame.jacobian.bottomRows<3>(), J_w_dot = frame.jacobian_dot.bottomRows<3>();
    out.jacobian = c.lazyProduct(J_w);
    out.jacobian_dot = c.lazyProduct(J_w_dot) + c_dot.lazyProduct(J_w);

    // n, n' and the part of n'' that does not depend on w'.
    const Vector3 w_rel = w - w_d, m_rel = w_rel.cross(m);
    const Vector3 moved = w_rel.cross(w.cross(m)) - w_d.cross(m_rel) - w_d_dot.cross(m);
    const Vector3 n = R_d.transpose() * m, n_dot = R_d.transpose() * m_rel;
    const Vector3 n_ddot_free = R_d.transpose() * moved;

    // s e and s e', which stay bounded, and s u; their bound is the margin, not the largest error.
    const double s = std::max(1.0 + n[2], antipode_margin);
    const Vector2 e_scaled = -n.head<2>(), e_dot_scaled = -flattened(n, n_dot);
    out.error = -stereographic(n);
    out.error_rate = e_dot_scaled / s;
    const Vector2 wanted =
        feedback.Kv * e_dot_scaled + feedback.Kp * e_scaled + s * feedback.offset;

    // The tangent vectors R_dᵀc: w' along the second normal accelerates n along the first, w'
    // along the first one against the second.
    const auto along = [&](Index k) {
      const Vector3 tangent = R_d.transpose() * c.row(k).transpose();
      return flattened(n, tangent).dot(wanted) - n_dot.squaredNorm() / s * tangent[2] +
             tangent.dot(2.0 * n_dot[2] / s * n_dot - n_ddot_free);
    };
    out.acceleration << -along(1), along(0);
    // (c J_w v)' of a frame that turns in its joint
    out.acceleration -= c * frame.own_acceleration.tail<3>() + c_dot * frame.own_velocity.tail<3>();
  }
};

}  // namespace hsp
