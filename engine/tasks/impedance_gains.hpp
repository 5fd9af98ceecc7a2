// From an impedance to the gains that give it at a state.
//
// With J_e the Jacobian of the error's coordinates, e' = -J_e v plus the reference's motion,
// G = Λ⁻¹ = J_e M⁻¹ J_eᵀ and an external force f, τ = J_eᵀ f:
//
//   e'' = e''_commanded - G f
//
// so that e''_commanded = -Kv e' - Kp e with
//
//   Kp = G S,    Kv = -½ G' Λ + G D + 2 ζ √(G K)
//
// gives Λ e'' + (½ Λ' + D + D_ζ) e' + S e = -f, because Λ' = -Λ G' Λ. S = K up to the spring's
// largest force (slipping.hpp). D_ζ = 2 ζ Λ √(G K) is symmetric, and damps each mode of (Λ, K)
// with the ratio ζ; where there is no stiffness, nothing. With G = B Bᵀ and K = C Cᵀ, let
// Cᵀ B = Uᵀ diag(ω) Q, the rows of Q orthonormal and ω the natural frequencies of the modes:
//
//   √(G K) = G C (Cᵀ G C)^(-½) Cᵀ = B Qᵀ U Cᵀ,
//
// which needs no inverse, neither of G nor of K. Only the first term does. There Λ = J̄ᵀ M J̄, with
// the pseudo-inverse J̄ = M⁻¹J_eᵀΛ, bounded where the law bounds its own.
#pragma once
#include <cmath>
#include <hsp/linalg.hpp>
#include <hsp/rotations.hpp>
#include <limits>

#include "feedback.hpp"
#include "slipping.hpp"

namespace hsp {

// The rows of an error that are a rotation vector, and the rotating frame.
struct Rotating {
  int first;               // of the three rows; the number of rows if there are none
  In<3, 3> rotation;       // world ← frame
  In<3> angular_velocity;  // of the frame, in world axes
};

struct ImpedanceGains {
  static constexpr const char* doc =
      "Λ⁻¹, Kp and Kv of an impedance; NaN where M is singular, so that the step is not finite.";
  In<'n', 'n'> M;
  In<'n', 'n'> M_dot;
  Rotating rotating;
  Impedance impedance;
  Ints<'g'> ends;         // where each part of the error ends
  TaskSample<In> sample;  // of the task, independent of its gains
  double threshold;       // of the law's singularities
  Out<'m', 'm'> G, Kp, Kv;

  Scratch<'n', 'n'> L;
  Scratch<'m', 'n'> J_e, J_e_dot, B, X, Z, Q;
  Scratch<'m', 'm'> G_dot, Lambda, C, U, root, factor, S;
  BoundedStiffness bounded;

  void check() const {
    if (rotating.first < 0) throw std::invalid_argument("rotating.first is less than 0");
    check_at_least("a task", G.rows(), 1);
    check_groups(ends, G.rows());
  }
  void operator()() {
    if (!cholesky(M, L)) {
      Kp(0, 0) = Kv(0, 0) = std::numeric_limits<double>::quiet_NaN();
      return;
    }
    const auto& [K, D, ratio, inverse_force] = impedance;
    write_error_jacobian();
    B = J_e;
    solve_rows(L, B);  // B = J_e L⁻ᵀ
    X = B;
    solve_rows_transposed(L, X);  // X = J_e M⁻¹
    G = B.lazyProduct(B.transpose());
    // G' = A Xᵀ + X Aᵀ with A = J_e' - ½ X M'.
    J_e_dot -= 0.5 * X.lazyProduct(M_dot);
    G_dot = J_e_dot.lazyProduct(X.transpose());
    G_dot += X.lazyProduct(J_e_dot.transpose());

    Kv = G.lazyProduct(D);
    if (ratio[0] > 0.0) {
      write_natural_root();
      Kv += 2.0 * ratio[0] * root;
    }
    write_bounded_inertia();
    Kv -= 0.5 * G_dot.lazyProduct(Lambda);
    if (bounded.write(impedance, ends, sample.error, S)) Kp = G.lazyProduct(S);
    else Kp = G.lazyProduct(K);
  }

 private:
  // J_e and J_e': J and J', but T J and its rate for a rotation vector. e = -y with y' = T ω,
  // T = Jlog(y) Rᵀ, plus the reference's motion; hence T' = -Jlog Jexp' T - T [ω]×.
  void write_error_jacobian() {
    J_e = sample.jacobian;
    J_e_dot = sample.jacobian_dot;
    const auto& [first, R, w] = rotating;
    if (first + 3 > J_e.rows()) return;
    const Vector3 y = -sample.error.segment<3>(first), y_dot = -sample.error_rate.segment<3>(first);
    const Matrix3 J_log = jlog3(y), T = J_log * R.transpose();
    const Matrix3 T_dot = -J_log * jexp3_dot(y, y_dot) * T - T * skew(w);
    const auto J = sample.jacobian.middleRows<3>(first);
    const auto J_dot = sample.jacobian_dot.middleRows<3>(first);
    J_e.middleRows<3>(first) = T.lazyProduct(J);
    J_e_dot.middleRows<3>(first) = T.lazyProduct(J_dot) + T_dot.lazyProduct(J);
  }

  // √(G K) = B Qᵀ U Cᵀ. Where a mode has no frequency, Q has no row.
  void write_natural_root() {
    factor_stiffness(impedance.K, C, S);
    Z = C.transpose().lazyProduct(B);
    orthogonalise_rows(Z, U);  // diag(ω) Q
    for (Index k = 0; k < Z.rows(); ++k) {
      const double frequency = Z.row(k).norm();
      if (frequency > 0.0) Z.row(k) /= frequency;
    }
    S = U.lazyProduct(C.transpose());
    factor = B.lazyProduct(Z.transpose());
    root = factor.lazyProduct(S);
  }

  // Λ = (B#)ᵀ B# = Xᵀ Q Qᵀ X with B# = Qᵀ X, the inverse of B Bᵀ; it fades to zero where B loses
  // rank. The rows of Q are orthogonal. The law whitens with its own metric: W = I at worst, where
  // the singular values of J L⁻ᵀ may be less than those of J by √(largest eigenvalue of M).
  void write_bounded_inertia() {
    bounded_inverse(B, threshold / std::sqrt(1.0 + M.trace()), Q, factor, S);
    for (Index k = 0; k < Q.rows(); ++k) factor.row(k) *= Q.row(k).norm();
    Lambda = factor.transpose().lazyProduct(factor);
  }
};

}  // namespace hsp
