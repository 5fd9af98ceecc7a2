// The workspace boundary: the law is exact where tasks can be met, and damped where they cannot.
//
//   a = a_exact + μ (a_damped - a_exact),      0 ≤ μ ≤ 1
//
// Out of reach an error persists, and with it the feedback's command. Near a singular posture
// the exact inverse of that changes faster than a sampled loop can follow, so the inverse of
// a_damped is bounded by thresholds that follow the command (`threshold.hpp`). But a
// threshold cannot distinguish an error that persists from a step within reach. Three conditions
// can: a singularity, a large error, or an active limit. So μ has three shares, each of them 0 in
// the interior of the workspace:
//
//   near    σ ≥ σ_x: 0;  σ ≤ σ_x/2: 1.    σ_x is a tenth of the robot's size
//   far     |e| ≤ 0.85 ℓ: 0;  |e| ≥ ℓ: 1.      ℓ is the largest error that is fed back
//   limits  a_t is within all limits: 0;  it is three times the permitted one: 1;
//           at most r_f, what errors at rest command of the permitted one
//
// with σ the smallest singular value of the stack J, whatever the metric. The first two are here,
// the last is in `limit_share.hpp`, where limits are known. All are continuous, so a is.
#pragma once
#include <hsp/linalg.hpp>

namespace hsp {

// 0 for x ≤ 0 and 1 for x ≥ 1, and between them 3x² - 2x³.
inline double smooth_share(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

// How near a singular posture is, from 0 to 1. `edge` is σ_x [m]; the law is not exact below
// twice ε_0. The other arguments are scratch memory. The share is 1 long before rounding shows in
// σ.
template <class J, class B, class X, class S>
double near_share(const J& jacobian, double edge, double least, B& rows, X& factor, S& square,
                  SymmetricSpectrum& spectrum) {
  const double middle = std::max(edge, 2.0 * least);
  if (exact_inverse(jacobian, middle, rows, factor, square)) return 0.0;
  return smooth_share(2.0 - 2.0 * smallest_singular_value(factor, square, spectrum) / middle);
}

// The share of large errors, from 0 to 1; `stretched` is |e|/ℓ of each row.
template <class S> double far_share(const S& stretched, double far) {
  const double most = greatest(stretched);
  return smooth_share((most - far) / (1.0 - far));
}

}  // namespace hsp
