#include "../src/rooms.hpp"
#include "equal_steps.hpp"
#include "steps.hpp"

namespace hsp {
const Kind* const* integrator_kinds() {
  return kinds<EqualSteps, EulerStep, Rk4Begin, Rk4Stage, Rk4End>();
}
}  // namespace hsp
