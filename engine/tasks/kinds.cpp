#include "../src/rooms.hpp"
#include "follow_impedance.hpp"
#include "impedance_gains.hpp"
#include "relative_kinematics.hpp"
#include "track_direction.hpp"
#include "track_orientation.hpp"
#include "track_position.hpp"
#include "track_posture.hpp"

namespace hsp {
const Kind* const* task_kinds() {
  return kinds<FeedbackAcceleration, DemandAtRest, TrackAxes, TrackPosture, TrackOrientation,
               TrackPose, TrackDirection, RelativeKinematics, SpringStiffness, SpringPulls,
               ImpedanceGains, FollowImpedance>();
}
}  // namespace hsp
