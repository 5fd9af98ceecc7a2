// The inverse condition number of a Jacobian.
#pragma once
#include <hsp/kind.hpp>

#include "gram.hpp"

namespace hsp {

// With G = J Jᵀ + ε I of k rows and φ = -f = k²/(tr G · tr G⁻¹),
//
//   ∂f/∂J = 2 φ (J/tr G - G⁻²J/tr G⁻¹),   (tr G⁻¹)' = -tr(G⁻¹ G' G⁻¹),
//
// and Y = G⁻¹J, Z = G⁻¹Y = G⁻²J, hence Y' = G⁻¹(J' - G'Y) and Z' = G⁻¹(Y' - G'Z).
struct InverseCondition {
  static constexpr const char* doc = "f = -k²/(tr G · tr G⁻¹), G = J Jᵀ of k rows, and ∂f/∂J.";
  double floor;  // ε
  In<'k', 'n'> J, J_dot;
  Out<'k', 'n'> slope, slope_rate;
  Scratch<'k', 'n'> Y, Y_dot, Z, Z_dot;
  Scratch<'k', 'k'> G, G_dot, L, G_inverse;

  double operator()() {
    const double k = static_cast<double>(J.rows());
    G = J.lazyProduct(J.transpose());
    G.diagonal().array() += floor;
    G_dot = J_dot.lazyProduct(J.transpose()) + J.lazyProduct(J_dot.transpose());
    cholesky(G, L);
    G_inverse.setIdentity();
    solve_gram(L, G_inverse);
    solve_with_rate(L, G_dot, J, J_dot, Y, Y_dot);
    solve_with_rate(L, G_dot, Y, Y_dot, Z, Z_dot);
    const double size = G.trace(), size_dot = G_dot.trace();
    const double stretch = G_inverse.trace();
    const double stretch_dot =
        -G_inverse.lazyProduct(G_dot).cwiseProduct(G_inverse.transpose()).sum();
    const double phi = k * k / (size * stretch);
    const double phi_dot = -phi * (size_dot / size + stretch_dot / stretch);
    slope = J / size - Z / stretch;  // without 2 φ, at first
    slope_rate = J_dot / size - size_dot / (size * size) * J - Z_dot / stretch +
                 stretch_dot / (stretch * stretch) * Z;
    slope_rate = 2.0 * (phi_dot * slope + phi * slope_rate);
    slope *= 2.0 * phi;
    return -phi;
  }
};

}  // namespace hsp
