// The efforts against gravity, and their derivatives with respect to q and along the motion.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/records.hpp>

namespace hsp {

// A column of the Jacobian of all joints, (l, w) at the world's origin, moves the bodies beyond
// it, of mass m, with s = Σ m c of their centres of mass. To Σ m c it adds x = m l + w × s, so
// gravity g requires the effort
//
//   G_k = -g·x_k,   ∂G_k/∂q_i = w_i·(g × x_k) where i carries k or is of the same joint,
//                             = w_k·(g × x_i) where i is beyond k,
//
// and 0 where neither carries the other. Along v, with the angular velocity Ω of the bodies before
// k and the motion ξ = Σ x_i v_i of those beyond it,
//
//   x_k' = Ω × x_k + w_k × ξ,
//
// and G'' at constant v is the rate of ∂G/∂q, times v. Columns of followers are added to their
// leader's.
struct Gravity {
  static constexpr const char* doc =
      "The efforts G against gravity, their slope ∂G/∂q, and G'' at constant velocity.";
  Columns<6, 'x'> jacobian, jacobian_dot;  // in world axes at the world's origin
  In<'j', 12> placements;                  // of the joints; see JointJacobians
  In<'j'> mass;                            // of the body at a joint [kg]
  In<'j', 3> center;                       // its centre of mass in the joint [m]
  Flags<'x', 'j'> moves;                   // whether a column moves a joint
  Ints<'x'> joints, dofs;                  // of each column
  In<3> gravity;                           // in the world [m/s²]
  In<'n'> v;
  Out<'n'> effort;      // G [N·m or N]
  Out<'n', 'n'> slope;  // ∂G/∂q
  Out<'n'> drift;       // G'' at constant v
  struct Memory {
    Eigen::Matrix3Xd x, x_dot, moment;
    void prepare(const Sizes& size) {
      x.setZero(3, size('x'));
      x_dot.setZero(3, size('x'));
      moment.setZero(3, size('j'));
    }
  } memory;

  void check() const {
    check_indices("joints", joints, mass.size());
    check_indices("dofs", dofs, v.size());
  }

  auto l(Index k) const { return jacobian.col(k).head<3>(); }
  auto w(Index k) const { return jacobian.col(k).tail<3>(); }
  auto w_dot(Index k) const { return jacobian_dot.col(k).tail<3>(); }
  bool carries(Index i, Index k) const { return moves(i, joints[k]); }

  void operator()() {
    auto& [x, x_dot, moment] = memory;
    const Vector3 g = gravity;
    for (Index b = 0; b < mass.size(); ++b) {
      const Eigen::Map<const Matrix3> R(placements.row(b).data());  // column by column
      const Eigen::Map<const Vector3> p(placements.row(b).data() + 9);
      moment.col(b) = mass[b] * (p + R * center.row(b).transpose());
    }
    effort.setZero();
    for (Index k = 0; k < x.cols(); ++k) {
      double m = 0.0;
      Vector3 s = Vector3::Zero();
      for (Index b = 0; b < mass.size(); ++b)
        if (moves(k, b)) {
          m += mass[b];
          s += moment.col(b);
        }
      x.col(k) = m * l(k) + w(k).cross(s);
      effort[dofs[k]] -= g.dot(x.col(k));
    }
    for (Index k = 0; k < x.cols(); ++k) {
      Vector3 turns = Vector3::Zero(), beyond = Vector3::Zero();  // Ω and ξ
      for (Index i = 0; i < x.cols(); ++i)
        if (carries(i, k)) turns += v[dofs[i]] * w(i);
        else if (carries(k, i)) beyond += v[dofs[i]] * x.col(i);
      x_dot.col(k) = turns.cross(x.col(k)) + w(k).cross(beyond);
    }
    slope.setZero();
    drift.setZero();
    for (Index k = 0; k < x.cols(); ++k)
      for (Index i = 0; i < x.cols(); ++i) {
        const bool above = carries(i, k);
        if (!above && !carries(k, i)) continue;
        const Index turning = above ? i : k, turned = above ? k : i;
        const Vector3 z = g.cross(x.col(turned)), z_dot = g.cross(x_dot.col(turned));
        slope(dofs[k], dofs[i]) += w(turning).dot(z);
        drift[dofs[k]] += v[dofs[i]] * (w_dot(turning).dot(z) + w(turning).dot(z_dot));
      }
  }
};

}  // namespace hsp
