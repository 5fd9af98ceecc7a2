// The forward dynamics, and the rates of the mass matrix and of the momentum.
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/centroidal.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "pinocchio.hpp"

namespace hsp {

ConstVector Dynamics::Pinocchio::moved(const ConstVector& q, const ConstVector& v, double h) {
  step = h * v;
  pin::integrate(model, q, step, there);
  return view(there);
}

// C + Cᵀ, with Coriolis' matrix C. Pinocchio has none of models with followers: there it is by
// differences of the fourth order. And what a ramp of what is carried adds.
void Dynamics::mass_matrix_rate(const ConstVector& q, const ConstVector& v, Square M_dot) {
  auto& own = *pinocchio_;
  if (own.has_followers()) own.write_rate_by_differences(q, v, M_dot);
  else {
    const auto& C = pin::computeCoriolisMatrix(own.model, own.data, q, v);
    M_dot = C + C.transpose();
  }
  // M is linear in the inertias: what a body adds is the difference with and without all of it.
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

void Dynamics::centroidal_map(const ConstVector& q, const ConstVector& v, Vector3& c, Jacobian A,
                              Jacobian A_dot) {
  auto& data = pinocchio_->data;
  if (pinocchio_->has_followers()) {
    c = pinocchio_->map_of_followers(q, v, A, A_dot);
    return;
  }
  data.vcom[0].setZero();  // it reads this, and writes it later
  pin::computeCentroidalMapTimeVariation(pinocchio_->model, data, q, v);
  c = data.com[0];
  A = data.Ag;
  A_dot = data.dAg;
}

}  // namespace hsp
