#include "plan.hpp"
#include "rooms.hpp"

namespace hsp {
const Kind* const* plan_kinds() { return kinds<Once, OnlyIf>(); }
}  // namespace hsp
