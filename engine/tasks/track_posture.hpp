// The task of joint positions: a displacement from a reference configuration.
//
//   J = rows of the identity,  e = d - (q ⊖ reference) [rad or m],  a_x = d'' + Kv e' + Kp s(e)
//
// The error of a continuous joint is within ±π.
#pragma once
#include "../robot/joint_displacements.hpp"
#include "feedback.hpp"

namespace hsp {

struct TrackPosture {
  static constexpr const char* doc = "e = displacement - (q ⊖ reference) of joints.";
  In<'q'> q;
  In<'n'> v;
  In<'q'> reference;
  Ints<'m', 3> joints;  // index in v, index in q, entries in q
  TrajectorySample<In, 'm'> displacement;
  Feedback<> feedback;
  TaskSample<Out> out;

  void check() const { check_joint_rows(joints, q.size(), v.size()); }
  void operator()() {
    out.jacobian.setZero();
    out.jacobian_dot.setZero();
    for (Index k = 0; k < joints.rows(); ++k) {
      const Index i = joints(k, 0);
      out.jacobian(k, i) = 1.0;
      double e = displacement.position[k] - joint_displacement(q, reference, joints.row(k));
      if (joints(k, 2) == 2) e = std::atan2(std::sin(e), std::cos(e));
      out.error[k] = e;
      out.error_rate[k] = displacement.velocity[k] - v[i];
    }
    out.acceleration = displacement.acceleration;
    feedback.add_to(out.acceleration, out.error, out.error_rate);
  }
};

}  // namespace hsp
