// Orientations in local coordinates: R = R_b exp(y) about a base R_b.
#pragma once
#include <numbers>

#include "orientations.hpp"

namespace hsp {

struct OrientationOfChart {
  static constexpr const char* doc =
      "R = R_b exp(y), ω = R Jexp y' and ω' = R (Jexp y'' + Jexp' y').";
  In<3, 3> base;
  TrajectorySample<In, 3> y;
  OrientationSample<Out> out;

  void operator()() {
    const OrientationSample<Own> at_rest{base, Vector3::Zero(), Vector3::Zero()};
    turn_from(at_rest, y, out);
  }
};

struct RotationVectors {
  static constexpr const char* doc =
      "y = log(R_bᵀ R) of each quaternion, on the branch nearest to the one before.";
  In<'k', 4> quaternions;  // x, y, z, w
  In<3, 3> base;
  Out<'k', 3> y;

  void operator()() {
    constexpr double turn = 2.0 * std::numbers::pi;
    for (Index k = 0; k < y.rows(); ++k) {
      const Matrix3 R = rotation_from_quaternion(quaternions.row(k).transpose());
      y.row(k) = log3(base.transpose() * R).transpose();
      const double angle = y.row(k).norm();
      if (k == 0 || angle == 0.0) continue;
      // y and y (1 - 2π/|y|) are the same rotation.
      const double along = y.row(k).dot(y.row(k - 1)) / angle;
      y.row(k) *= 1.0 - turn * std::nearbyint((angle - along) / turn) / angle;
    }
  }
};

}  // namespace hsp
