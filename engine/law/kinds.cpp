#include "../src/rooms.hpp"
#include "diagnosis.hpp"
#include "projections.hpp"

namespace hsp {
const Kind* const* law_kinds() {
  return kinds<Diagnose, SingularValues, SmallestMotion, TaskForce>();
}
}  // namespace hsp
