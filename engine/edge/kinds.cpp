#include "../src/rooms.hpp"
#include "resolve.hpp"
#include "self_motions.hpp"

namespace hsp {
const Kind* const* edge_kinds() { return kinds<Resolve, SelfMotions>(); }
}  // namespace hsp
