#include "calls.hpp"

namespace hsp {
const Kind* const* dynamics_kinds() {
  return kinds<JointJacobians, Carry, ChangeGravity, Weights, BodyInertias, Difference,
               InverseDynamics, ForwardDynamics, MassMatrix, MassMatrixRate, CentroidalMotion>();
}
}  // namespace hsp
