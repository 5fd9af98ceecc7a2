#include "../src/rooms.hpp"
#include "frame_kinematics.hpp"
#include "gravity.hpp"

namespace hsp {
const Kind* const* robot_kinds() { return kinds<FrameKinematics, Gravity>(); }
}  // namespace hsp
