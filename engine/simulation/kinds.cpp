#include "../src/rooms.hpp"
#include "periods.hpp"

namespace hsp {
const Kind* const* simulation_kinds() { return kinds<Periods>(); }
}  // namespace hsp
