// Yoshikawa's measure of manipulability (1985), or functions of it.
#pragma once
#include <cmath>
#include <hsp/kind.hpp>

#include "gram.hpp"

namespace hsp {

// J are the selected rows of a frame's Jacobian, scaled (`SelectRows`), so that metres and radians
// can be added; A : B = Σ A_ij B_ij. `ChainGradient` computes the gradient in q from ∂f/∂J.
//
// With G = J W⁻¹ Jᵀ + ε I and φ = ½ log det G,
//
//   ∂φ/∂J = G⁻¹ J W⁻¹,   (∂φ/∂J)' = G⁻¹ (J'W⁻¹ - G' G⁻¹ J W⁻¹),   φ' = ∂φ/∂J : J'.
//
// f = -φ; or, with a power p > 0 of √(det G), f = -exp(p φ), so that ∂f = p f ∂φ, f' = p f φ'.
struct Manipulability {
  static constexpr const char* doc = "f = -½ log det G or -(det G)^(p/2), G = J W⁻¹ Jᵀ, and ∂f/∂J.";
  In<'n', 'n'> inverse_metric;  // W⁻¹
  bool weighted;                // whether it is not the identity
  double floor;                 // ε
  int power;                    // p; 0 for the logarithm
  In<'k', 'n'> J, J_dot;
  Out<'k', 'n'> slope, slope_rate;
  Scratch<'k', 'n'> JW, JW_dot;
  Scratch<'k', 'k'> G, G_dot, L;

  double operator()() {
    if (weighted) {
      JW = J.lazyProduct(inverse_metric);
      JW_dot = J_dot.lazyProduct(inverse_metric);
    } else {
      JW = J;
      JW_dot = J_dot;
    }
    G = JW.lazyProduct(J.transpose());
    G.diagonal().array() += floor;
    G_dot = JW_dot.lazyProduct(J.transpose()) + J.lazyProduct(JW_dot.transpose());
    cholesky(G, L);
    const double phi = L.diagonal().array().log().sum();
    solve_with_rate(L, G_dot, JW, JW_dot, slope, slope_rate);
    const double phi_dot = slope.cwiseProduct(J_dot).sum();
    const double f = power > 0 ? -std::exp(power * phi) : -phi;
    const double outer = power > 0 ? power * f : -1.0;  // ∂f = outer ∂φ
    const double outer_dot = power > 0 ? power * outer * phi_dot : 0.0;
    slope_rate = outer * slope_rate + outer_dot * slope;
    slope *= outer;
    return f;
  }
};

}  // namespace hsp
