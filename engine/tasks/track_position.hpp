// The task of a point along axes of the world: a frame's origin or a centre of mass.
//
//   J = the axes' rows of the point's J,    e = x_d - x [m],    a_x = x_d'' + Kv e' + Kp s(e)
//
// s(e) is e up to a largest length, see `feedback.hpp`.
#pragma once
#include <hsp/indices.hpp>

#include "feedback.hpp"

namespace hsp {

struct TrackAxes {
  static constexpr const char* doc = "e = x_d - x of a point along axes of the world.";
  Ints<'m'> axes;  // 0, 1, 2: x, y, z of the world
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
    for (Index k = 0; k < axes.size(); ++k) out.acceleration[k] -= point.own_acceleration[axes[k]];
    feedback.add_to(out.acceleration, out.error, out.error_rate);
  }
};

}  // namespace hsp
