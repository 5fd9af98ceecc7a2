// The gradient of a function φ of a frame's Jacobian, with its exact rate.
//
// Let i and j be degrees of freedom of the chain to a frame, and J_j = (l_j, w_j) their columns
// in world axes at the frame's origin. A motion of i changes J_j by
//
//   w_i × (l_j, w_j)   if i comes before j in the chain, or both belong to one joint,
//   (w_j × l_i, 0)     if j comes before i,
//
// for revolute joints, prismatic joints and floating roots. With ∂φ/∂J = B, columns (b_j, c_j),
// φ therefore has the gradient
//
//   w_i · Σ_{j from i on} (l_j × b_j + w_j × c_j) + l_i · Σ_{j before i} (b_j × w_j)
//
// which running sums compute in O(n), without the kinematic Hessian. Its rate is exact too, because
// J' is known exactly.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/records.hpp>

namespace hsp {

struct SelectRows {
  static constexpr const char* doc = "J and J' of a frame's selected rows, each scaled.";
  FrameMotion<In> frame;
  Ints<'k'> selected;
  In<'k'> scale;
  Out<'k', 'n'> J, J_dot;

  void check() const { check_indices("selected", selected, 6); }
  void operator()() {
    for (Index k = 0; k < selected.size(); ++k) {
      J.row(k) = scale[k] * frame.jacobian.row(selected[k]);
      J_dot.row(k) = scale[k] * frame.jacobian_dot.row(selected[k]);
    }
  }
};

struct ChainGradient {
  static constexpr const char* doc = "∇f and (∇f)' of f = φ(J), from ∂φ/∂J of scaled rows.";
  In<6, 'n'> J, J_dot;
  In<'k', 'n'> slope, slope_rate;  // ∂φ/∂J and its rate, of the selected rows
  Ints<'k'> selected;
  In<'k'> scale;
  Ints<'s'> dofs;   // the dofs that move the frame, from the root on
  Ints<'s'> first;  // index among them at which the joint of each begins
  Out<'n'> gradient, rate;
  Scratch<6, 'n'> B, B_dot;  // zero in the rows that are not selected
  Scratch<'s', 3> before, before_dot, from_here, from_here_dot;

  void check() const {
    check_indices("selected", selected, 6);
    check_indices("dofs", dofs, gradient.size());
    check_indices("first", first, dofs.size());
  }

  // A column of one of these: its linear and its angular part.
  struct Column {
    template <class M>
    Column(const M& matrix, Index j)
        : linear(matrix.col(j).template head<3>()), angular(matrix.col(j).template tail<3>()) {}
    Vector3 linear, angular;
  };

  void operator()() {
    for (Index k = 0; k < selected.size(); ++k) {
      B.row(selected[k]) = scale[k] * slope.row(k);
      B_dot.row(selected[k]) = scale[k] * slope_rate.row(k);
    }
    Vector3 sum = Vector3::Zero(), sum_dot = Vector3::Zero();
    for (Index p = 0; p < dofs.size(); ++p) {
      const auto [l, w] = Column(J, dofs[p]);
      const auto [l_dot, w_dot] = Column(J_dot, dofs[p]);
      const auto [b, c] = Column(B, dofs[p]);
      const auto [b_dot, c_dot] = Column(B_dot, dofs[p]);
      before.row(p) = sum;
      before_dot.row(p) = sum_dot;
      sum += b.cross(w);
      sum_dot += b_dot.cross(w) + b.cross(w_dot);
    }
    sum.setZero();
    sum_dot.setZero();
    for (Index p = dofs.size() - 1; p >= 0; --p) {
      const auto [l, w] = Column(J, dofs[p]);
      const auto [l_dot, w_dot] = Column(J_dot, dofs[p]);
      const auto [b, c] = Column(B, dofs[p]);
      const auto [b_dot, c_dot] = Column(B_dot, dofs[p]);
      sum += l.cross(b) + w.cross(c);
      sum_dot += l_dot.cross(b) + l.cross(b_dot) + w_dot.cross(c) + w.cross(c_dot);
      from_here.row(p) = sum;
      from_here_dot.row(p) = sum_dot;
    }
    gradient.setZero();
    rate.setZero();
    for (Index p = 0; p < dofs.size(); ++p) {
      const auto [l, w] = Column(J, dofs[p]);
      const auto [l_dot, w_dot] = Column(J_dot, dofs[p]);
      const Vector3 moment = from_here.row(first[p]), moment_dot = from_here_dot.row(first[p]);
      const Vector3 force = before.row(first[p]), force_dot = before_dot.row(first[p]);
      gradient[dofs[p]] = w.dot(moment) + l.dot(force);
      rate[dofs[p]] = w_dot.dot(moment) + w.dot(moment_dot) + l_dot.dot(force) + l.dot(force_dot);
    }
  }
};

}  // namespace hsp
