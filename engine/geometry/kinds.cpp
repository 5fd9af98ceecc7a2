#include "../src/rooms.hpp"
#include "distances.hpp"

namespace hsp {
const Kind* const* geometry_kinds() {
  return kinds<MeasureDistances, DistanceGradients, AddForce>();
}
}  // namespace hsp
