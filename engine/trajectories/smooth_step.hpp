// The smooth step from 0 to 1, and mixtures by it.
#pragma once
#include <hsp/records.hpp>

namespace hsp {

struct SmoothStep {
  double s, s_dot, s_ddot;

  // s alone rounds to 1 at u = 1 - 2e-6, where s'' is not yet zero.
  bool over() const { return s == 1.0 && s_ddot == 0.0; }
};

// s(t) = 10 u³ - 15 u⁴ + 6 u⁵ with u = (t - t0)/T.
//
// s goes from 0 to 1 with zero velocity and acceleration at both ends; of all such motions it
// has the minimum jerk. It is exactly 0 before and exactly 1 after, hence C². The peaks of s'
// and s'' are 1.875/T and 5.77/T².
inline SmoothStep smooth_step(double t, double start_time, double duration) {
  const double T = duration, u = (t - start_time) / T, rest = 1.0 - u;
  if (u <= 0.0) return {0.0, 0.0, 0.0};
  if (u >= 1.0) return {1.0, 0.0, 0.0};
  return {u * u * u * (10.0 + u * (6.0 * u - 15.0)), 30.0 * u * u * rest * rest / T,
          60.0 * u * rest * (rest - u) / (T * T)};
}

// x = (1 - s) a + s b = a + s (b - a), x' and x''. The sample x may be a or b.
template <class A, class B, class X>
void mix(const SmoothStep& step, const A& a, const B& b, X& x) {
  const auto [s, s_dot, s_ddot] = step;
  x.acceleration = a.acceleration + s_ddot * (b.position - a.position) +
                   2.0 * s_dot * (b.velocity - a.velocity) + s * (b.acceleration - a.acceleration);
  x.velocity = a.velocity + s_dot * (b.position - a.position) + s * (b.velocity - a.velocity);
  x.position = a.position + s * (b.position - a.position);
}

}  // namespace hsp
