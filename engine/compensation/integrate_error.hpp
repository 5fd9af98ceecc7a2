// Integral action of a task.
#pragma once
#include <hsp/kind.hpp>
#include <hsp/linalg.hpp>

namespace hsp {

struct IntegrateError {
  static constexpr const char* doc =
      "∫e over one period, and the offset Ki ∫e, no entry of it beyond a limit; where the law is "
      "not delivered as it is, ∫e may only decrease.";
  In<'m'> e;
  In<'m', 'm'> Ki;
  double limit;
  In<1> period;
  Ints<1> damped, status, starting;
  std::int64_t limited;  // lowest status of a step that is not the law's
  InOut<'m'> integral;
  Out<'m'> offset;

  void operator()() {
    const bool saturated = damped[0] || status[0] >= limited || starting[0];
    for (Index i = 0; i < e.size(); ++i)
      if (!(saturated && e[i] * integral[i] >= 0.0)) integral[i] += e[i] * period[0];
    offset.noalias() = Ki * integral;
    const double largest = greatest(offset.cwiseAbs());
    if (!(largest > limit)) return;
    integral *= limit / largest;
    offset *= limit / largest;
  }
};

}  // namespace hsp
