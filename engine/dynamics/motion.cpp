// Kinematics, the inverse dynamics, the mass matrix, and the momentum of followers.
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include <hsp/rotations.hpp>

#include "pinocchio.hpp"

namespace hsp {

void Dynamics::joint_jacobians(const ConstVector& q, const ConstVector& v, Jacobian J,
                               Jacobian J_dot, Placements placements) {
  auto& data = pinocchio_->data;
  pin::computeJointJacobiansTimeVariation(pinocchio_->model, data, q, v);
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

// Pinocchio's own (4.1) accumulates into memory that it does not clear, and omits the coupling of
// joints of several degrees of freedom between a leader and its follower. Here M is the sum of Jᵀ I
// J over pairs of each joint and its ancestors, with the composite inertia I beyond the joint, at
// the world's origin; columns of a follower are added to its leader's.
void Dynamics::Pinocchio::write_mass_matrix_of_followers(const ConstVector& q) {
  pin::computeJointJacobians(model, data, q);
  auto& carried_by = data.oYcrb;
  for (int i = 1; i < model.njoints; ++i) carried_by[i] = data.oMi[i].act(model.inertias[i]);
  data.M.setZero();
  data.M.diagonal() = model.armature;
  for (int i = model.njoints - 1; i > 0; --i) {
    const auto& joint = model.joints[i];
    const Eigen::Matrix<double, 6, 6> I = carried_by[i].matrix();
    for (int k = 0; k < joint.nvExtended(); ++k) {
      const Eigen::Matrix<double, 6, 1> momentum = I * data.J.col(joint.idx_vExtended() + k);
      const int row = joint.idx_v() + k;
      for (int j = i; j > 0; j = model.parents[j]) {
        const auto& bearer = model.joints[j];
        for (int l = 0; l < bearer.nvExtended(); ++l) {
          const int column = bearer.idx_v() + l;
          const double shared = momentum.dot(data.J.col(bearer.idx_vExtended() + l));
          data.M(row, column) += shared;
          if (j != i) data.M(column, row) += shared;
        }
      }
    }
    if (model.parents[i] > 0) carried_by[model.parents[i]] += carried_by[i];
  }
  data.M.triangularView<Eigen::StrictlyLower>() = data.M.transpose();  // to the last bit
}

void Dynamics::mass_matrix(const ConstVector& q, Square M) { M = pinocchio_->mass_matrix(q); }

// Pinocchio's own assumes that each joint has its own columns of v. Here a joint's columns are I J,
// with the composite inertia I beyond the joint, at the world's origin (Orin, Goswami and Lee
// 2013), and those of a follower are added to its leader's. The result is then moved to the centre
// of mass.
Vector3 Dynamics::Pinocchio::map_of_followers(const ConstVector& q, const ConstVector& v,
                                              Jacobian A, Jacobian A_dot) {
  pin::computeJointJacobiansTimeVariation(model, data, q, v);
  auto& carried = data.oYcrb;
  auto& rate = data.doYcrb;
  carried[0].setZero();
  for (int i = 1; i < model.njoints; ++i) {
    carried[i] = data.oMi[i].act(model.inertias[i]);
    rate[i] = carried[i].variation(data.oMi[i].act(data.v[i]));
  }
  A.setZero();
  A_dot.setZero();
  for (int i = model.njoints - 1; i > 0; --i) {
    const auto& joint = model.joints[i];
    const Eigen::Matrix<double, 6, 6> I = carried[i].matrix();
    for (int k = 0; k < joint.nvExtended(); ++k) {
      const auto J = data.J.col(joint.idx_vExtended() + k);
      const auto J_dot = data.dJ.col(joint.idx_vExtended() + k);
      A.col(joint.idx_v() + k) += I * J;
      A_dot.col(joint.idx_v() + k) += rate[i] * J + I * J_dot;
    }
    carried[model.parents[i]] += carried[i];
    if (model.parents[i] > 0) rate[model.parents[i]] += rate[i];
  }
  const Vector3 c = carried[0].lever();
  A.bottomRows<3>() -= skew(c).lazyProduct(A.topRows<3>());
  A_dot.bottomRows<3>() -= skew(c).lazyProduct(A_dot.topRows<3>());
  return c;
}

}  // namespace hsp
