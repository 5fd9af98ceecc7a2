#include "../src/rooms.hpp"
#include "limited_target.hpp"
#include "parts.hpp"
#include "resolve.hpp"
#include "self_motions.hpp"

namespace hsp {
const Kind* const* edge_kinds() {
  return kinds<Resolve, SelfMotions, LimitedTarget, WriteThresholds, ThresholdBelow, HowHeld>();
}
}  // namespace hsp
