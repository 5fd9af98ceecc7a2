#include "../src/rooms.hpp"
#include "stream_alone.hpp"

namespace hsp {
const Kind* const* stream_kinds() {
  return kinds<PieceState, WaypointPiece, VelocityPiece, StreamAlone>();
}
}  // namespace hsp
