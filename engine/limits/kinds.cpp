#include <hsp/copy.hpp>

#include "../src/rooms.hpp"
#include "acceleration_bounds.hpp"
#include "barrier_rows.hpp"
#include "check.hpp"
#include "distance_rows.hpp"
#include "holding_rows.hpp"
#include "mixed_parts.hpp"
#include "nearest_effort.hpp"
#include "sent_effort.hpp"
#include "support.hpp"

namespace hsp {
const Kind* const* limit_kinds() {
  return kinds<NearestEffort, Copy, AccelerationBounds, Within, EffortWindow, ExpectedVelocity,
               Observe, IsPlain, CheckLimits, ForceMap, MinimumNormForces, CommandedForce,
               WrenchShares, SlidingFriction, WithinCones, Displace, DistancesAt, NearPairs,
               ApproachedPairs, DistanceRows, HoldingRows, Clear, CheckRows, PlaceRows, KeepPart,
               MixParts, HasShare, FadingContact, FadingForces>();
}
}  // namespace hsp
