#include "../src/rooms.hpp"
#include "deviation_cost.hpp"
#include "dual_active_set.hpp"
#include "limited_step.hpp"
#include "relaxed_step.hpp"

namespace hsp {
const Kind* const* qp_kinds() {
  return kinds<Directions, InverseRoot, BeginLimitedStep, LimitedRows, SolveLimitedStep,
               LimitedResult, RelaxedRows, LeastViolation, Widen, Minimise>();
}
}  // namespace hsp
