#include "../src/rooms.hpp"
#include "hold.hpp"

namespace hsp {
const Kind* const* contact_kinds() { return kinds<HoldPoint, HoldNormal, HoldSurface>(); }
}  // namespace hsp
