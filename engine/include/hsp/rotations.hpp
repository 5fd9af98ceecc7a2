// Rotations: exp, log and their Jacobians on SO(3).
//
// A rotation vector y is a rotation by the angle √(y·y) about y. With s = y·y and the Stumpff
// functions C_k(s) = Σ_j (-s)^j/(k + 2j)!, each matrix below is a combination of I, [y]× and
// y yᵀ. It is regular at 0; only Jlog is singular, at 2π:
//
//   exp(y)  = C0 I       + C1 [y]× + C2 y yᵀ
//   Jexp(y) = C1 I       - C2 [y]× + C3 y yᵀ     ω = Jexp(y) y'
//   Jlog(y) = C1/(2C2) I + ½ [y]×  + d  y yᵀ     y' = Jlog(y) ω,  Jlog = Jexp⁻¹
//
// where d = (C3 - 2 C4)/(2 C2), and ω is the angular velocity in the body's axes.
#pragma once
#include <array>
#include <cmath>
#include <hsp/view.hpp>

namespace hsp {

// C0 to C5 at s = |y|² ≥ 0: cos t, sin t/t, (1 - cos t)/t², (t - sin t)/t³, ... with t = √s, and
// C_k = 1/k! - s C_{k+2}. Their derivative is dC_k/ds = (k C_{k+2} - C_{k+1})/2. Absolute errors
// are at rounding: below s = 10, which is above π², so that the range of log uses it only, C4
// and C5 come from a series and the others from the recurrence downwards; above, C1 comes from
// the sine and the others from the recurrence upwards.
inline std::array<double, 6> stumpff(double s) {
  constexpr double series_below = 10.0, short_below = 0.2;
  constexpr int all = 14, few = 6;  // terms; few of them reach rounding where s is small
  static constexpr auto inverse_factorial = [] {
    std::array<double, 5 + 2 * all> found{};
    double factorial = 1.0;
    for (std::size_t k = 0; k < found.size(); ++k) {
      if (k > 0) factorial *= static_cast<double>(k);
      found[k] = 1.0 / factorial;
    }
    return found;
  }();
  if (s < series_below) {
    double C4 = 0.0, C5 = 0.0;
    for (int j = (s < short_below ? few : all) - 1; j >= 0; --j) {
      C4 = inverse_factorial[4 + 2 * j] - s * C4;
      C5 = inverse_factorial[5 + 2 * j] - s * C5;
    }
    const double C2 = 0.5 - s * C4, C3 = 1.0 / 6.0 - s * C5;
    return {1.0 - s * C2, 1.0 - s * C3, C2, C3, C4, C5};
  }
  const double t = std::sqrt(s), half_sine = std::sin(0.5 * t), C1 = std::sin(t) / t;
  const double C2 = 2.0 * half_sine * half_sine / s, C3 = (1.0 - C1) / s;
  return {1.0 - s * C2, C1, C2, C3, (0.5 - C2) / s, (1.0 / 6.0 - C3) / s};
}

inline Matrix3 skew(const Vector3& y) {
  return (Matrix3() << 0.0, -y[2], y[1], y[2], 0.0, -y[0], -y[1], y[0], 0.0).finished();
}

// identity I + cross [y]× + outer y yᵀ
inline Matrix3 combine(double identity, double cross, double outer, const Vector3& y) {
  return identity * Matrix3::Identity() + cross * skew(y) + outer * y * y.transpose();
}

inline Matrix3 exp3(const Vector3& y) {
  const auto C = stumpff(y.squaredNorm());
  return combine(C[0], C[1], C[2], y);
}

// The right Jacobian of exp: ω = Jexp(y) y'.
inline Matrix3 jexp3(const Vector3& y) {
  const auto C = stumpff(y.squaredNorm());
  return combine(C[1], -C[2], C[3], y);
}

// Its rate, so that ω' = Jexp y'' + Jexp' y'.
inline Matrix3 jexp3_dot(const Vector3& y, const Vector3& y_dot) {
  const auto C = stumpff(y.squaredNorm());
  const double half_s_dot = y.dot(y_dot);
  const double C1_dot = (C[3] - C[2]) * half_s_dot, C2_dot = (2.0 * C[4] - C[3]) * half_s_dot;
  const double C3_dot = (3.0 * C[5] - C[4]) * half_s_dot;
  return combine(C1_dot, -C2_dot, C3_dot, y) - C[2] * skew(y_dot) +
         C[3] * (y * y_dot.transpose() + y_dot * y.transpose());
}

// The inverse of Jexp, for |y| < 2π.
inline Matrix3 jlog3(const Vector3& y) {
  const auto C = stumpff(y.squaredNorm());
  return combine(0.5 * C[1] / C[2], 0.5, 0.5 * (C[3] - 2.0 * C[4]) / C[2], y);
}

// The unit quaternion whose scalar part is not negative, from the row of 4 q qᵀ with the largest
// diagonal.
inline Eigen::Quaterniond quaternion_from_rotation(const Matrix3& R) {
  const double a = R(0, 0), b = R(1, 1), c = R(2, 2);
  Eigen::Quaterniond q;
  if (a + b + c >= std::max({a, b, c})) {
    q.vec() << R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1);
    q.w() = 1.0 + a + b + c;
  } else if (a >= b && a >= c) {
    q.vec() << 1.0 + a - b - c, R(0, 1) + R(1, 0), R(2, 0) + R(0, 2);
    q.w() = R(2, 1) - R(1, 2);
  } else if (b >= c) {
    q.vec() << R(0, 1) + R(1, 0), 1.0 - a + b - c, R(1, 2) + R(2, 1);
    q.w() = R(0, 2) - R(2, 0);
  } else {
    q.vec() << R(2, 0) + R(0, 2), R(1, 2) + R(2, 1), 1.0 - a - b + c;
    q.w() = R(1, 0) - R(0, 1);
  }
  q.normalize();
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return q;
}

// The rotation vector of R, |y| ≤ π, accurate to rounding from 0 to π: the quaternion's vector
// part stays accurate near π, where the trace and the skew part of R both lose digits. At π
// either sign of y is right.
inline Vector3 log3(const Matrix3& R) {
  const Eigen::Quaterniond q = quaternion_from_rotation(R);
  const double sine = q.vec().norm();  // of the half angle; w ≥ 0 is its cosine
  return (sine > 0.0 ? 2.0 * std::atan2(sine, q.w()) / sine : 2.0) * q.vec();
}

// The rotation of a quaternion (x, y, z, w) of any length but zero.
inline Matrix3 rotation_from_quaternion(const Eigen::Vector4d& q) {
  const double w = q[3], scale = 2.0 / q.squaredNorm();
  return combine(w * w * scale - 1.0, w * scale, scale, q.head<3>());
}

}  // namespace hsp
