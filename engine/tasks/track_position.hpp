// The tasks of a point, along axes of the world, and of joint positions.
#pragma once
#include "../robot/joint_displacements.hpp"
#include "feedback.hpp"

namespace hsp {

struct TrackAxes {
  static constexpr const char* doc = "e = x_d - x of a point along axes of the world.";
  Ints<'m'> axes;
  PointMotion<In> point;
  TrajectorySample<In, 'm'> desired;
  Feedback<> feedback;
  TaskSample<Out> out;

  void check() const { check_indices("axes", axes, 3); }
  void operator()() {
    for (Index k = 0; k < axes.size(); ++k) {
      const Index i = axes[k];
      out.jacobian.row(k) = point.jacobian.row(i);
      out.jacobian_dot.row(k) = point.jacobian_dot.row(i);
      out.error[k] = desired.position[k] - point.position[i];
      out.error_rate[k] = desired.velocity[k] - point.velocity[i];
    }
    out.acceleration = desired.acceleration;
    feedback.add_to(out.acceleration, out.error, out.error_rate);
  }
};

// J are rows of the identity. The error of a continuous joint is within ±π.
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
