#include "../src/rooms.hpp"
#include "diagnosis.hpp"

namespace hsp {
const Kind* const* law_kinds() { return kinds<Diagnose, SingularValues>(); }
}  // namespace hsp
