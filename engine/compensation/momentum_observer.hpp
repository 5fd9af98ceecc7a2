// The momentum observer of De Luca: an estimate r of the effort that the model does not explain.
//
// With p = M v, p' = tau + Cᵀv - G + d, and Cᵀv - G = M'v - N since M' = C + Cᵀ, N = C v + G.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/kind.hpp>
#include <hsp/linalg.hpp>
#include <limits>

namespace hsp {

struct ObserveMomentum {
  static constexpr const char* doc =
      "r ← a low-pass of d = Δp/h - tau - (mean of Cᵀv - G) over the period that ends.";
  In<'n', 'n'> M, M_dot;
  In<'n'> v, nonlinear_effects;
  In<'n'> acted;                      // the effort on the model in that period
  In<1> period;                       // h [s]
  double bandwidth, most_per_period;  // K_O [1/s], and the largest K_O h
  In<'n'> clip;
  InOut<'o', 'n'> memory;      // states of the low-pass, r the last of them
  InOut<'n'> momentum, drift;  // p and Cᵀv - G at the last measurement
  InOutInts<1> begun;
  Out<'n'> cancelled;  // r, clipped
  Scratch<'n'> p, now, d;

  void operator()() {
    p.noalias() = M * v;
    now.noalias() = M_dot * v;
    now -= nonlinear_effects;
    if (begun[0]) {
      const double h = period[0], rate = std::min(bandwidth, most_per_period / h);
      // Exact for an input that is constant in the period.
      const double share = 1.0 - std::exp(-static_cast<double>(memory.rows()) * rate * h);
      d = (p - momentum) / h - acted - 0.5 * (now + drift);
      for (Index k = 0; k < memory.rows(); ++k) {
        memory.row(k) += share * (d.transpose() - memory.row(k));
        d = memory.row(k).transpose();
      }
      cancelled = d.cwiseMax(-clip).cwiseMin(clip);
    }
    momentum = p;
    drift = now;
    begun[0] = 1;
  }
};

struct Unexplained {
  static constexpr const char* doc =
      "M⁻¹ (r - its cancelled part): the acceleration by external causes.";
  In<'n', 'n'> M;
  In<'n'> disturbance, cancelled;
  Out<'n'> acceleration;
  Scratch<'n', 'n'> L;

  void operator()() {
    acceleration = disturbance - cancelled;
    if ((acceleration.array() == 0.0).all()) return;
    if (!cholesky(M, L)) {
      acceleration.setConstant(std::numeric_limits<double>::quiet_NaN());
      return;
    }
    solve_lower(L, acceleration);
    solve_lower_transposed(L, acceleration);
  }
};

}  // namespace hsp
