#include "../src/rooms.hpp"
#include "frame_kinematics.hpp"
#include "gravity.hpp"
#include "tool_in_joint.hpp"

namespace hsp {
const Kind* const* robot_kinds() { return kinds<FrameKinematics, Gravity, ToolInJoint>(); }
}  // namespace hsp
