#include "calls.hpp"

namespace hsp {
const Kind* const* dynamics_kinds() {
  return kinds<JointJacobians, Carry, BodyMasses, InverseDynamics, ForwardDynamics, MassMatrix,
               MassMatrixRate, CentroidalMotion>();
}
}  // namespace hsp
