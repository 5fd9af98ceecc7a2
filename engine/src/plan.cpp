#include "rooms.hpp"
#include "plan.hpp"

namespace hsp {
const Kind* const* plan_kinds() { return kinds<Once, OnlyIf, EqualSteps>(); }
}  // namespace hsp
