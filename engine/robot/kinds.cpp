#include "../src/rooms.hpp"
#include "frame_kinematics.hpp"
#include "inertia.hpp"

namespace hsp {
const Kind* const* robot_kinds() {
  return kinds<FrameKinematics, Clear, InertiaRate, CentroidalRows>();
}
}  // namespace hsp
