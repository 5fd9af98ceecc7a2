// Costs of joint positions: the middle of the range, a posture, equal angles, limits.
#pragma once
#include <cmath>
#include <hsp/records.hpp>
#include <numbers>

#include "../robot/joint_displacements.hpp"
#include "barrier.hpp"

namespace hsp {

// Throws if the joints with limits do not fit these sizes of q and v.
inline void check_limited(const Ints<'k', 2>& limited, Index q, Index v) {
  check_indices("the joints' indices in v", limited.col(0), v);
  check_indices("the joints' indices in q", limited.col(1), q);
}

struct JointCentering {
  static constexpr const char* doc = "f = ½ Σ k_i (q_i - m_i)² of the joints with limits.";
  In<'q'> q;
  In<'n'> v;
  Ints<'k', 2> limited;       // indices in v and in q
  In<'k'> middle, stiffness;  // m, and k = w_i/r_i² [1/s]
  Out<'n'> gradient, rate;
  Scratch<'k'> away;

  void check() const { check_limited(limited, q.size(), v.size()); }
  double operator()() {
    const auto dofs = limited.col(0), at = limited.col(1);
    away = q(at) - middle;
    gradient.setZero();
    rate.setZero();
    gradient(dofs) = stiffness.cwiseProduct(away);
    rate(dofs) = stiffness.cwiseProduct(v(dofs));
    return 0.5 * away.dot(stiffness.cwiseProduct(away));
  }
};

// d = q ⊖ target ⊖ displacement(t). Continuous joints have 1 - cos d in the place of ½d², which
// has a kink at an angle of π from the target.
struct TargetPosture {
  static constexpr const char* doc = "f = Σ w_i ½d_i², Σ w_i (1 - cos d_i) of continuous joints.";
  In<'q'> q;
  In<'n'> v;
  In<'q'> target;
  TrajectorySample<In, 'n'> displacement;
  Ints<'s', 3> single_dof_joints;  // indices in v and in q, and number of coordinates
  In<'n'> weights;                 // w [1/s]
  Out<'n'> gradient, rate;

  void check() const { check_joint_rows(single_dof_joints, q.size(), v.size()); }
  double operator()() {
    gradient.setZero();
    rate.setZero();
    joint_displacements(q, target, single_dof_joints, gradient);
    double f = 0.0;
    for (Index k = 0; k < single_dof_joints.rows(); ++k) {
      const Index i = single_dof_joints(k, 0);
      const bool continuous = single_dof_joints(k, 2) != 1;
      const double w = weights[i], d = gradient[i] - displacement.position[i];
      const double d_dot = v[i] - displacement.velocity[i];
      f += w * (continuous ? 1.0 - std::cos(d) : 0.5 * d * d);
      gradient[i] = w * (continuous ? std::sin(d) : d);
      rate[i] = w * (continuous ? std::cos(d) * d_dot : d_dot);
    }
    return f;
  }
};

// An angle in [-π, π).
inline double wrapped(double angle) {
  constexpr double turn = 2.0 * std::numbers::pi;
  return angle - turn * std::floor((angle + std::numbers::pi) / turn);
}

struct EqualJointAngles {
  static constexpr const char* doc = "f = Σ d_k², d_k = q_{k+1} - q_k in [-π, π), along a chain.";
  In<'q'> q;
  In<'n'> v;
  In<'q'> neutral;
  Ints<'s', 3> single_dof_joints;
  Ints<'k'> chain;  // indices in v
  Out<'n'> gradient, rate;
  Scratch<'n'> angles;

  void check() const {
    check_joint_rows(single_dof_joints, q.size(), v.size());
    check_indices("chain", chain, v.size());
  }
  double operator()() {
    joint_displacements(q, neutral, single_dof_joints, angles);
    gradient.setZero();
    rate.setZero();
    double f = 0.0;
    for (Index k = 0; k + 1 < chain.size(); ++k) {
      const Index i = chain[k], j = chain[k + 1];
      const double d = wrapped(angles[j] - angles[i]), d_dot = v[j] - v[i];
      f += d * d;
      gradient[i] -= 2.0 * d;
      gradient[j] += 2.0 * d;
      rate[i] -= 2.0 * d_dot;
      rate[j] += 2.0 * d_dot;
    }
    return f;
  }
};

struct LimitBarrier {
  static constexpr const char* doc =
      "f = Σ w_i (b((q_i - lower_i)/u_i) + b((upper_i - q_i)/u_i)) of the joints with limits.";
  In<'q'> q;
  In<'n'> v;
  Ints<'k', 2> limited;                 // indices in v and in q
  In<'k'> lower, upper, unit, weights;  // u, and w [1/s]
  Out<'n'> gradient, rate;

  void check() const { check_limited(limited, q.size(), v.size()); }
  double operator()() {
    gradient.setZero();
    rate.setZero();
    double f = 0.0;
    for (Index k = 0; k < limited.rows(); ++k) {
      const Index i = limited(k, 0), at = limited(k, 1);
      const double u = unit[k];
      const BarrierValue low = barrier_at((q[at] - lower[k]) / u);
      const BarrierValue high = barrier_at((upper[k] - q[at]) / u);
      f += weights[k] * (low.value + high.value);
      gradient[i] = weights[k] * (low.slope - high.slope) / u;
      rate[i] = weights[k] * (low.curvature + high.curvature) / (u * u) * v[i];
    }
    return f;
  }
};

}  // namespace hsp
