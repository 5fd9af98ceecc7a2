#include "../src/rooms.hpp"
#include "stream.hpp"

namespace hsp {
const Kind* const* stream_kinds() { return kinds<PieceState, Stream>(); }
}  // namespace hsp
