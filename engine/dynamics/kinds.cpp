#include "calls.hpp"

namespace hsp {
const Kind* const* dynamics_kinds() {
  return kinds<JointJacobians, Carry, ChangeGravity, Weights, Bodies, Difference, InverseDynamics,
               ForwardDynamics, MassMatrix, MassMatrixRate, CentroidalMotion>();
}
}  // namespace hsp
