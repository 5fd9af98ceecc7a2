#include "../src/rooms.hpp"
#include "filter_velocity.hpp"
#include "integrate_error.hpp"
#include "momentum_observer.hpp"
#include "start_up.hpp"

namespace hsp {
const Kind* const* compensation_kinds() {
  return kinds<FilterVelocity, StartUp, ObserveMomentum, Unexplained, IntegrateError>();
}
}  // namespace hsp
