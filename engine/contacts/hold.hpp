// Rows that keep a contact at rest: points, the normal of a sliding contact, surfaces.
//
//   J a + J'v = -Kd J v,    damping without stiffness.
#pragma once
#include <hsp/records.hpp>
#include <hsp/rotations.hpp>

namespace hsp {

// e' = -J v, and the acceleration Kd e', which damps the contact's motion.
template <class Sample, class V> void damp_velocity(const V& v, double damping, Sample& out) {
  out.error_rate = -out.jacobian.lazyProduct(v);
  out.acceleration = damping * out.error_rate;
}

// A point that is fixed to a frame, with the arm r = R p + s from the frame's origin, whose shift s
// does not turn. p is in the frame, s in world axes [m]. With l and w the frame's linear and
// angular rows its rows are l + w × r, and their rate is l' + w' × r + w × r', where r' = ω × R p.
struct FramePoint {
  FrameMotion<In> frame;
  In<3> position, shift;  // p and s

  template <class J, class J_dot> void write_rows(J& rows, J_dot& rows_dot) const {
    const Vector3 turned = frame.rotation * position, omega = frame.velocity.tail<3>();
    const Matrix3 r = skew(turned + shift), r_dot = skew(omega.cross(turned));
    const auto w = frame.jacobian.bottomRows<3>(), w_dot = frame.jacobian_dot.bottomRows<3>();
    rows = frame.jacobian.topRows<3>() - r.lazyProduct(w);
    rows_dot = frame.jacobian_dot.topRows<3>() - r.lazyProduct(w_dot) - r_dot.lazyProduct(w);
  }
};

struct HoldPoint {
  static constexpr const char* doc = "A point of a frame does not move.";
  FramePoint point;
  In<'n'> v;
  double damping;
  TaskSample<Out, 3> out;

  void operator()() {
    point.write_rows(out.jacobian, out.jacobian_dot);
    damp_velocity(v, damping, out);
  }
};

struct HoldNormal {
  static constexpr const char* doc = "A point of a frame does not move along a normal.";
  FramePoint point;
  In<3> normal;
  In<'n'> v;
  double damping;
  TaskSample<Out, 1> out;
  Scratch<3, 'n'> rows, rows_dot;

  void operator()() {
    point.write_rows(rows, rows_dot);
    out.jacobian = normal.transpose().lazyProduct(rows);
    out.jacobian_dot = normal.transpose().lazyProduct(rows_dot);
    damp_velocity(v, damping, out);
  }
};

struct HoldSurface {
  static constexpr const char* doc = "A frame neither moves nor turns.";
  FrameMotion<In> frame;
  In<'n'> v;
  double damping;
  TaskSample<Out, 6> out;

  void operator()() {
    out.jacobian = frame.jacobian;
    out.jacobian_dot = frame.jacobian_dot;
    damp_velocity(v, damping, out);
  }
};

}  // namespace hsp
