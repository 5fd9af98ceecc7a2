#include "../src/rooms.hpp"
#include "deliver.hpp"
#include "evolve.hpp"
#include "evolve_impedance.hpp"
#include "load.hpp"
#include "mixed_sets.hpp"
#include "offset_effort.hpp"
#include "payloads.hpp"
#include "safe_stop.hpp"

namespace hsp {
const Kind* const* frozen_kinds() {
  return kinds<Deliver, ForcesWithin, DeliverWithForces, OffsetEffort, Subtract, HasMoved, Evolve,
               EvolveImpedance, EvolveAhead, ScaledIdentity, BodyInJoint, Payloads, Brake,
               ScaleIntoLimits, EstimateLoad, ChooseSets, KeepLevel, MixSets>();
}
}  // namespace hsp
