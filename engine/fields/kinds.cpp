#include "../src/rooms.hpp"
#include "barrier.hpp"
#include "descent.hpp"
#include "inverse_condition.hpp"
#include "jacobian_cost.hpp"
#include "joint_costs.hpp"
#include "manipulability.hpp"
#include "point_distance.hpp"
#include "ramp_weight.hpp"

namespace hsp {
const Kind* const* field_kinds() {
  return kinds<JointCentering, TargetPosture, EqualJointAngles, LimitBarrier, PointDistance,
               SelectRows, ChainGradient, Manipulability, InverseCondition, Barrier,
               GradientDescent, RampWeight, ProductWeight, AddWeighted>();
}
}  // namespace hsp
