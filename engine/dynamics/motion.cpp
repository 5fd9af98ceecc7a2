// Kinematics, the inverse dynamics, and the mass matrix.
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "pinocchio.hpp"

namespace hsp {

void Dynamics::Pinocchio::joint_jacobians(const ConstVector& q, const ConstVector& v) {
  pin::computeJointJacobiansTimeVariation(model, data, q, v);
}

void Dynamics::joint_jacobians(const ConstVector& q, const ConstVector& v, Jacobian J,
                               Jacobian J_dot, Placements placements) {
  auto& data = pinocchio_->data;
  pinocchio_->joint_jacobians(q, v);
  J = data.J;
  J_dot = data.dJ;
  for (Index i = 0; i < placements.rows(); ++i) {
    const auto& joint = data.oMi[i];
    placements.row(i) << joint.rotation().reshaped().transpose(), joint.translation().transpose();
  }
}

void Dynamics::inverse_dynamics(const ConstVector& q, const ConstVector& v, const ConstVector& a,
                                Eigen::Map<Vector> effort) {
  effort = pin::rnea(pinocchio_->model, pinocchio_->data, q, v, a);
}

const Dynamics::Pinocchio::Data::MatrixXs& Dynamics::Pinocchio::mass_matrix(const ConstVector& q) {
  if (has_followers()) {
    write_mass_matrix_of_followers(q);
    return data.M;
  }
  pin::impl::crbaLocalConvention(model, data, q);  // `pin::crba` compiles another one, too
  data.M.triangularView<Eigen::StrictlyLower>() = data.M.transpose();
  return data.M;
}

void Dynamics::mass_matrix(const ConstVector& q, Square M) { M = pinocchio_->mass_matrix(q); }

}  // namespace hsp
