#include "../src/rooms.hpp"
#include "curves.hpp"

namespace hsp {
const Kind* const* trajectory_kinds() { return kinds<Circle, Lissajous, UniformLine>(); }
}  // namespace hsp
