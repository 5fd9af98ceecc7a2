// Terms computed from the joints' Jacobians and the bodies' inertias: the mass matrix of models
// with followers, the rates of the mass matrix and of the momentum, and the forward dynamics.
//
// Let Y be the inertia of all bodies beyond a joint, at the world's origin, and s_k a column of the
// joint's Jacobian. Its momentum is h_k = Y s_k, with the rate h_k' = Y' s_k + Y s_k', and
//
//   M_kl = h_k · s_l,   M_kl' = h_k' · s_l + h_k · s_l',   A_k = h_k,   A_k' = h_k'
//
// where l is a column of k's joint, or of one that carries it (Orin, Goswami and Lee 2013). Columns
// of a follower are added to its leader's. Pinocchio's own algorithms (4.1) assume that each joint
// has its own columns; its CRBA of followers accumulates into memory that it does not clear.
#include <pinocchio/algorithm/cholesky.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>

#include <hsp/rotations.hpp>

#include "pinocchio.hpp"

namespace hsp {

void Dynamics::difference(const ConstVector& start, const ConstVector& end,
                          Eigen::Map<Vector> displacement) const {
  pin::difference(pinocchio_->model, start, end, displacement);
}

void Dynamics::Pinocchio::compute_momenta() {
  auto& Y = data.oYcrb;
  Y[0].setZero();
  for (int i = 1; i < model.njoints; ++i) Y[i] = data.oMi[i].act(model.inertias[i]);
  for (int i = model.njoints - 1; i > 0; --i) {
    const auto& joint = model.joints[i];
    momenta.middleCols(joint.idx_vExtended(), joint.nvExtended()) =
        Y[i].matrix().lazyProduct(data.J.middleCols(joint.idx_vExtended(), joint.nvExtended()));
    Y[model.parents[i]] += Y[i];
  }
}

void Dynamics::Pinocchio::compute_momentum_rates(bool of_masses) {
  compute_momenta();
  auto& rate = data.doYcrb;
  rate[0].setZero();
  for (int i = 1; i < model.njoints; ++i)
    rate[i] = data.oMi[i].act(model.inertias[i]).variation(data.oMi[i].act(data.v[i]));
  if (of_masses)
    for (const Carried& body : carried)
      rate[body.joint] +=
          body.rate *
          data.oMi[body.joint].act(spatial_inertia(body.mass, body.center, body.inertia)).matrix();
  for (int i = model.njoints - 1; i > 0; --i) {
    const auto& joint = model.joints[i];
    const Index first = joint.idx_vExtended(), count = joint.nvExtended();
    momentum_rates.middleCols(first, count) = rate[i].lazyProduct(data.J.middleCols(first, count));
    momentum_rates.middleCols(first, count) +=
        data.oYcrb[i].matrix().lazyProduct(data.dJ.middleCols(first, count));
    rate[model.parents[i]] += rate[i];
  }
}

// Add f(k, l) of columns to the entries of their rows of v, over each joint and its ancestors.
template <class Sum, class F> void Dynamics::Pinocchio::add_symmetric(Sum& sum, const F& f) const {
  for (int i = 1; i < model.njoints; ++i) {
    const auto& joint = model.joints[i];
    for (int a = 0; a < joint.nvExtended(); ++a) {
      const int k = joint.idx_vExtended() + a, row = joint.idx_v() + a;
      for (int j = i; j > 0; j = model.parents[j]) {
        const auto& carrier = model.joints[j];
        for (int b = 0; b < carrier.nvExtended(); ++b) {
          const int l = carrier.idx_vExtended() + b, column = carrier.idx_v() + b;
          if (l > k) break;
          const double value = f(k, l);
          sum(row, column) += value;
          if (l != k) sum(column, row) += value;
        }
      }
    }
  }
}

void Dynamics::Pinocchio::write_mass_matrix_of_followers(const ConstVector& q) {
  joint_jacobians(q, view(zero));
  compute_momenta();
  data.M.setZero();
  data.M.diagonal() = model.armature;
  add_symmetric(data.M, [this](int k, int l) { return momenta.col(k).dot(data.J.col(l)); });
}

void Dynamics::mass_matrix_rate(const ConstVector& q, const ConstVector& v, Square M_dot) {
  auto& own = *pinocchio_;
  own.joint_jacobians(q, v);
  own.compute_momentum_rates(true);
  M_dot.setZero();
  own.add_symmetric(M_dot, [&own](int k, int l) {
    return own.momentum_rates.col(k).dot(own.data.J.col(l)) +
           own.momenta.col(k).dot(own.data.dJ.col(l));
  });
}

bool Dynamics::forward_dynamics(const ConstVector& q, const ConstVector& v, const ConstVector& tau,
                                Eigen::Map<Vector> a) {
  auto& own = *pinocchio_;
  inverse_dynamics(q, v, view(own.zero), a);
  a = tau - a;
  const auto& M = own.mass_matrix(q);
  if (own.has_followers()) {
    own.factor.compute(M);
    own.factor.solveInPlace(a);
    return own.factor.info() == Eigen::Success;
  }
  pin::cholesky::decompose(own.model, own.data);  // U D Uᵀ, as sparse as the tree
  pin::cholesky::solve(own.model, own.data, a);
  return (own.data.D.array() > 0.0).all();  // of none, too
}

// With shares s_k of masses m_k at p_k, and m the whole mass, c = (Σ m_i c_i + Σ s_k m_k p_k)/m has
//
//   c'  = u + w,   u = J v,   w = Σ s_k' m_k (p_k - c)/m
//   c'' = J v' + J' v + Σ m_k [s_k' (p_k' - u + p_k' - c') + s_k'' (p_k - c)]/m - m' w/m
//
// and h = m l, the angular momentum about c, adds Σ s_k' [I_k ω_k + m_k (p_k - c) × p_k'] - w × m u
// to h', so that l' has the m-th part of that less m' l.
MassFlow Dynamics::Pinocchio::mass_flow(const Vector3& c, const Vector3& u,
                                        const Vector3& l) const {
  double mass = 0.0, mass_rate = 0.0;
  for (const auto& body : model.inertias) mass += body.mass();
  Vector3 velocity = Vector3::Zero(), acceleration = velocity, momentum = velocity;
  for (const Carried& body : carried) {
    const auto& joint = data.oMi[body.joint];
    const Matrix3 R = joint.rotation();
    const Vector3 omega = R * data.v[body.joint].angular();
    const Vector3 arm = R * body.center, away = joint.translation() + arm - c;
    const Vector3 rate = R * data.v[body.joint].linear() + omega.cross(arm);
    const double flow = body.rate * body.mass;
    mass_rate += flow;
    velocity += flow * away;
    acceleration += 2.0 * flow * (rate - u) + body.acceleration * body.mass * away;
    momentum +=
        flow * away.cross(rate) + body.rate * (R * (body.inertia * (R.transpose() * omega)));
  }
  velocity /= mass;
  acceleration = (acceleration - 2.0 * mass_rate * velocity) / mass;
  momentum = (momentum - mass_rate * l) / mass - velocity.cross(u);
  return {velocity, acceleration, momentum};
}

// The sum of the momenta is about the world's origin; it is moved to the centre of mass.
MassFlow Dynamics::centroidal_map(const ConstVector& q, const ConstVector& v, Vector3& c,
                                  Jacobian A, Jacobian A_dot) {
  auto& own = *pinocchio_;
  own.joint_jacobians(q, v);
  own.compute_momentum_rates(false);
  A.setZero();
  A_dot.setZero();
  for (int i = 1; i < own.model.njoints; ++i) {
    const auto& joint = own.model.joints[i];
    for (int k = 0; k < joint.nvExtended(); ++k) {
      A.col(joint.idx_v() + k) += own.momenta.col(joint.idx_vExtended() + k);
      A_dot.col(joint.idx_v() + k) += own.momentum_rates.col(joint.idx_vExtended() + k);
    }
  }
  c = own.data.oYcrb[0].lever();
  A.bottomRows<3>() -= skew(c).lazyProduct(A.topRows<3>());
  A_dot.bottomRows<3>() -= skew(c).lazyProduct(A_dot.topRows<3>());
  if (own.carried.empty()) return {};
  const double m = mass();
  return own.mass_flow(c, A.topRows<3>() * v / m, A.bottomRows<3>() * v / m);
}

}  // namespace hsp
