// Memory of the sent efforts, and the range of the next one.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/indices.hpp>
#include <limits>

#include "records.hpp"

namespace hsp {

struct EffortWindow {
  static constexpr const char* doc =
      "The range of the next effort by limits on it and on its rate: tau ± rate T.";
  In<'w'> last;  // the last effort, and the time for which it is held: n + 1 numbers
  In<'n'> effort, rate;
  Out<'n'> lower, upper;

  void check() const { check_at_least("last", last.size(), effort.size() + 1); }
  void operator()() {
    const Index n = effort.size();
    const auto tau = last.head(n).array();
    const auto most = effort.array();
    const auto change = rate.array() * last[n];
    // The last effort may lie outside the limits: then move towards them.
    lower = (tau - change).max(-most).min(most);
    upper = (tau + change).min(most).max(-most);
  }
};

struct ExpectedVelocity {
  static constexpr const char* doc =
      "v + T (a + disturbance) at the end of a period T that begins now, and the time of that end.";
  In<1> time;
  In<'n'> v, a, disturbance;
  InOut<2> timing;
  Out<'n'> expected;

  void operator()() {
    timing[0] = time[0] + timing[1];
    expected = v + timing[1] * (a + disturbance);
  }
};

namespace sent {

// The acceleration is observed over this time, or over one period if that is longer [s]: over 1 ms
// noise of 0.02 rad/s would be 28 rad/s², over 10 ms it is 3.
constexpr double window = 0.01;
// The mean error for position limits is averaged over this time [s]: it has the velocity's noise
// over this time, 0.3 rad/s² for 0.01 rad/s.
constexpr double quick_time = 0.03;
// An error is weighted less after this time; over it the error that persists is averaged [s].
constexpr double memory = 0.1;

// The common part of two numbers: the nearer to 0 if they have the same sign, or 0.
inline double shared(double a, double b) {
  return std::max(std::min(a, b), 0.0) + std::min(std::max(a, b), 0.0);
}

}  // namespace sent

// Add a period that ends at the time t to the differences of velocity, and update the errors.
inline void observe(const In<'n'>& v, Held<InOut>& held, double t) {
  const double period = held.timing[1];
  if (!(std::abs(t - held.timing[0]) < 0.01 * period)) return;
  held.timing[0] = std::numeric_limits<double>::infinity();
  const double fresh = std::min(period / sent::window, 1.0);
  const double fading = std::exp(-period / sent::memory);
  const double quickly = std::exp(-period / sent::quick_time);
  for (Index i = 0; i < v.size(); ++i) {
    const double gained = v[i] - held.expected[i], error = gained / period;
    held.drift[i] = fading * held.drift[i] + (1.0 - fading) * error;
    held.quick[i] = quickly * held.quick[i] + (1.0 - quickly) * error;
    held.least[i] = std::min(fading * held.least[i], held.quick[i]);
    held.most[i] = std::max(fading * held.most[i], held.quick[i]);
    held.stray[i] = (1.0 - fresh) * held.stray[i] + gained;
    const double present = held.stray[i] / std::max(period, sent::window);
    held.error[i] = std::max(fading * held.error[i], std::abs(present));
    held.steady[i] = sent::shared(held.drift[i], present);
    held.lasting[i] = sent::shared(held.quick[i], present);
  }
}

struct Observe {
  static constexpr const char* doc = "Compare the velocity with the prediction for an effort.";
  In<'n'> v;
  Held<InOut> held;

  void operator()(double t) { observe(v, held, t); }
};

}  // namespace hsp
