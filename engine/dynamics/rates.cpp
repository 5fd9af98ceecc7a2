// The forward dynamics, and the rates of the mass matrix and of the momentum.
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "pinocchio.hpp"

namespace hsp {

void Dynamics::difference(const ConstVector& start, const ConstVector& end,
                          Eigen::Map<Vector> displacement) const {
  pin::difference(pinocchio_->model, start, end, displacement);
}

ConstVector Dynamics::Pinocchio::moved(const ConstVector& q, const ConstVector& v, double h) {
  step = h * v;
  pin::integrate(model, q, step, there);
  return view(there);
}

// C + Cᵀ, with Coriolis' matrix C. Pinocchio has none of models with followers: there it is by
// differences of the fourth order. The ramps of payloads are added.
void Dynamics::mass_matrix_rate(const ConstVector& q, const ConstVector& v, Square M_dot) {
  auto& own = *pinocchio_;
  if (own.has_followers()) own.write_rate_by_differences(q, v, M_dot);
  else {
    const auto& C = pin::computeCoriolisMatrix(own.model, own.data, q, v);
    M_dot = C + C.transpose();
  }
  // M is linear in the inertias: the contribution of a body is the difference with and without it.
  for (const Carried& body : own.carried) {
    if (body.rate == 0.0) continue;
    M_dot -= body.rate * own.mass_matrix(q);
    auto& inertia = own.model.inertias[body.joint];
    const pin::Inertia without = inertia;
    inertia += pin::Inertia(body.mass, body.center, body.inertia);
    M_dot += body.rate * own.mass_matrix(q);
    inertia = without;
  }
}

void Dynamics::Pinocchio::write_rate_by_differences(const ConstVector& q, const ConstVector& v,
                                                    Square M_dot) {
  const double h = 1e-3 / std::max(1.0, v.lpNorm<Eigen::Infinity>());
  M_dot.setZero();
  for (const double steps : {-2.0, -1.0, 1.0, 2.0}) {
    const double weight = std::abs(steps) == 1.0 ? 8.0 : -1.0;
    M_dot +=
        std::copysign(weight / (12.0 * h), weight * steps) * mass_matrix(moved(q, v, steps * h));
  }
}

// ABA, which does not support followers: M and N there.
bool Dynamics::forward_dynamics(const ConstVector& q, const ConstVector& v, const ConstVector& tau,
                                Eigen::Map<Vector> a) {
  auto& own = *pinocchio_;
  if (!own.has_followers()) {
    a = pin::impl::abaLocalConvention(own.model, own.data, q, v, tau);
    return true;
  }
  inverse_dynamics(q, v, view(own.zero), a);
  a = tau - a;
  own.factor.compute(own.mass_matrix(q));
  own.factor.solveInPlace(a);
  return own.factor.info() == Eigen::Success;
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

MassFlow Dynamics::centroidal_map(const ConstVector& q, const ConstVector& v, Vector3& c,
                                  Jacobian A, Jacobian A_dot) {
  auto& data = pinocchio_->data;
  if (pinocchio_->has_followers()) {
    c = pinocchio_->map_of_followers(q, v, A, A_dot);
  } else {
    data.vcom[0].setZero();  // read before it is written
    pin::computeCentroidalMapTimeVariation(pinocchio_->model, data, q, v);
    c = data.com[0];
    A = data.Ag;
    A_dot = data.dAg;
  }
  if (pinocchio_->carried.empty()) return {};
  const double m = mass();
  return pinocchio_->mass_flow(c, A.topRows<3>() * v / m, A.bottomRows<3>() * v / m);
}

}  // namespace hsp
