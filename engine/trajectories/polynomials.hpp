// Polynomials of time, alone and joined at knots.
#pragma once
#include <algorithm>
#include <hsp/indices.hpp>
#include <hsp/records.hpp>

namespace hsp {

// x = Σ_k c_k u^k, x' and x'', where u' = 1/T: Horner's scheme and its derivatives.
template <class Coefficients, class X>
void polynomial(double u, double T, const Coefficients& c, X& x) {
  x.position.setZero();
  x.velocity.setZero();
  x.acceleration.setZero();  // half of it, until the end
  for (Index k = c.rows() - 1; k >= 0; --k) {
    x.acceleration = x.acceleration * u + x.velocity;
    x.velocity = x.velocity * u + x.position;
    x.position = x.position * u + c.row(k).transpose();
  }
  x.velocity /= T;
  x.acceleration *= 2.0 / (T * T);
}

struct Polynomial {
  static constexpr const char* doc = "x(t) = Σ_k c_k u^k, u = (t - start)/(end - start).";
  double start, end;
  In<'p', 'd'> coefficients;
  TrajectorySample<Out> out;

  void operator()(double t) {
    polynomial((t - start) / (end - start), end - start, coefficients, out);
  }
};

struct PiecewisePolynomial {
  static constexpr const char* doc =
      "x(t) = Σ_k c_ik u^k, u = (t - t_i)/(t_{i+1} - t_i), from t_i to t_{i+1}.";
  In<'m'> times;  // the knots, increasing
  In<'m', 'd'> waypoints;
  In<'i', 'p', 'd'> coefficients;  // one polynomial less than knots
  TrajectorySample<Out> out;

  void check() const {
    check_at_least("times", times.size(), 1);
    check_at_least("coefficients", coefficients.size(), times.size() - 1);
  }
  // It rests exactly at the first waypoint before, and at the last one after.
  void operator()(double t) {
    const Index last = times.size() - 1;
    if (!(times[0] < t && t < times[last])) {  // also if a knot is not finite
      out.position = waypoints.row(t <= times[0] ? 0 : last).transpose();
      out.velocity.setZero();
      out.acceleration.setZero();
      return;
    }
    const double* after = std::upper_bound(times.data(), times.data() + last, t);
    const Index i = after - times.data() - 1;  // t_i <= t < t_{i+1}
    const double T = times[i + 1] - times[i];
    polynomial((t - times[i]) / T, T, coefficients[i], out);
  }
};

}  // namespace hsp
