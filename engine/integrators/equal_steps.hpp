// An interval of time in equal steps.
#pragma once
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "../src/plan.hpp"

namespace hsp {

struct EqualSteps {
  static constexpr const char* doc =
      "Divide an interval into the fewest equal steps that are not longer than one, and make the "
      "calls of each at its beginning.";
  Shared<Plan> calls;
  In<2> interval;
  double longest;
  Out<1> now, h;
  static constexpr double most = 1e9;

  void check() const {
    if (!(longest > 0.0)) throw std::invalid_argument("longest is more than 0");
  }
  void operator()() {
    const double start = interval[0], duration = interval[1] - start;
    const double steps = std::max(1.0, std::ceil(duration / longest - 1e-9));
    if (!(steps <= most)) throw std::invalid_argument("EqualSteps: more than 1e9 steps, or NaN");
    h[0] = duration / steps;
    for (double k = 0.0; k < steps; ++k) {
      now[0] = start + k * h[0];
      calls->run(now[0]);
    }
  }
};

}  // namespace hsp
