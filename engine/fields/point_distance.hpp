// The paper's obstacle cost: the distance of frames from a point.
#pragma once
#include <hsp/records.hpp>
#include <limits>

namespace hsp {

// With r from the centre to the frame and r' = J v - c' a frame adds
//
//   f = 1/d²,   ∇f = -2 Jᵀr/d⁴,   (∇f)' = -2 (J'ᵀr + Jᵀ(r' - 4 (r·r'/d²) r))/d⁴.
struct PointDistance {
  static constexpr const char* doc =
      "Add a frame's 1/d², d from its origin to a centre, to Σ 1/d², which it may begin.";
  bool first;
  FrameMotion<In> frame;
  TrajectorySample<In, 3> center;
  InOut<1> total;
  InOut<'n'> gradient, rate;

  double operator()() {
    constexpr double nearest = 1e-12;  // [m]; below it the frame is at the centre
    if (first) {
      total.setZero();
      gradient.setZero();
      rate.setZero();
    }
    const Vector3 r = frame.position - center.position;
    const Vector3 r_dot = frame.velocity.head<3>() - center.velocity;
    const double square = r.squaredNorm();
    if (square < nearest * nearest) {
      // The law reports that the field is not finite.
      total[0] = std::numeric_limits<double>::infinity();
      gradient.setConstant(total[0]);
      return total[0];
    }
    const auto J = frame.jacobian.topRows<3>(), J_dot = frame.jacobian_dot.topRows<3>();
    const double scale = -2.0 / (square * square);
    const Vector3 slope = scale * r;
    const Vector3 slope_dot = scale * (r_dot - 4.0 * r.dot(r_dot) / square * r);
    gradient.noalias() += J.transpose().lazyProduct(slope);
    rate.noalias() += J_dot.transpose().lazyProduct(slope);
    rate.noalias() += J.transpose().lazyProduct(slope_dot);
    total[0] += 1.0 / square;
    return total[0];
  }
};

}  // namespace hsp
