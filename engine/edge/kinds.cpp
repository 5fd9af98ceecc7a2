#include "../src/rooms.hpp"
#include "by_levels.hpp"
#include "held_levels.hpp"
#include "limit_share.hpp"
#include "limited_target.hpp"
#include "parts.hpp"
#include "resolve.hpp"
#include "self_motions.hpp"

namespace hsp {
const Kind* const* edge_kinds() {
  return kinds<Resolve, SelfMotions, ByLevels, HeldLevels, LimitShare, LimitedTarget, WriteThresholds,
               ThresholdBelow, HowHeld>();
}
}  // namespace hsp
