// An impedance that changes while the robot moves adds no energy: it waits where it would.
//
// With E = ½ e'ᵀΛe' + U(e), U the energy of the spring, and an external force f,
//
//   E' = fᵀx' - e'ᵀ(D + D_ζ) e' + ∂U/∂t.
//
// The values in force follow the planned ones only as fast as ∂U/∂t is no more than the power of
// the damping. Where they are behind they catch up with half of the change's ramp as time constant,
// so that no effort jumps.
#pragma once
#include <algorithm>

#include "slipping.hpp"

namespace hsp {

// K, D, ζ and 1/F of each row, in one array of 2 m + 2 rows: see `Impedance.numbers`.
struct ImpedanceNumbers {
  const double* first;
  Index m;

  using Rows = Eigen::Map<const Matrix>;
  using Row = Eigen::Map<const Vector>;
  struct Parts {
    Rows K, D;
    Row ratio, inverse_force;
  };
  Parts parts() const {
    const Index square = m * m;
    return {{first, m, m},
            {first + square, m, m},
            {first + 2 * square, m},
            {first + 2 * square + m, m}};
  }
};

struct FollowImpedance {
  static constexpr const char* doc =
      "The numbers of an impedance for the next period, which follow those that were planned; "
      "whether they wait.";
  InOut<'r', 'm'> numbers;     // in force; see `ImpedanceNumbers`
  In<'r', 'm'> planned, then;  // for now, and for the end of the period
  Ints<'g'> ends;              // where each part of the error ends
  In<'m', 'm'> G;              // Λ⁻¹ in the coordinates of e
  In<'m'> e, e_dot;
  In<1> period, ramp;  // [s]; duration of the change
  InOutInts<1> waits;
  Scratch<'r', 'm'> step, ahead;
  Scratch<'m', 'm'> C, B, V, Z, S;
  Scratch<'m'> s, along;
  BoundedStiffness bounded;

  void check() const {
    check_at_least("an impedance", e.size(), 1);
    if (numbers.rows() != 2 * e.size() + 2) throw std::invalid_argument("numbers has 2 m + 2 rows");
    check_groups(ends, e.size());
  }

  void operator()() {
    const double h = period[0];
    step = then - numbers;
    const bool follows =
        ((numbers - planned).array().abs() <= 1e-9 + 1e-4 * planned.array().abs()).all();
    if (!follows) step *= std::min(2.0 * h / std::max(ramp[0], h), 1.0);
    ahead = numbers + step;
    const double needed = energy(ahead) - energy(numbers);
    if (needed > 0.0) {
      const double given = h * dissipated();
      if (needed > given) {
        numbers += given / needed * step;
        waits[0] = true;
        return;
      }
    }
    waits[0] = ahead != then;
    if (waits[0]) numbers = ahead;
    else numbers = then;
  }

 private:
  // Of a mode or a spring: smaller values, relative to the largest, are rounding.
  static constexpr double rounding = 1e-12;

  // U(e) = sᵀe - ½ sᵀK⁺s: ½ eᵀK e, and linear where s is at its bound.
  template <class Numbers> double energy(const Numbers& of) {
    const auto own = ImpedanceNumbers{of.data(), e.size()}.parts();
    if (!bounded.write(own, ends, e, S)) {
      s = own.K.lazyProduct(e);
      return 0.5 * s.dot(e);
    }
    s = S.lazyProduct(e);
    double length = 0.0;  // sᵀK⁺s, with K = C Cᵀ, the columns of C orthogonal
    const double most = greatest(bounded.C.colwise().squaredNorm());
    for (Index k = 0; k < s.size(); ++k) {
      const double stiffness = bounded.C.col(k).squaredNorm();
      if (stiffness <= rounding * most) continue;
      const double pull = bounded.C.col(k).dot(s);
      length += pull * pull / (stiffness * stiffness);
    }
    return s.dot(e) - 0.5 * length;
  }

  // e'ᵀ(D + D_ζ) e' [W], D_ζ = 2 ζ C (Cᵀ G C)^(-½) Cᵀ with K = C Cᵀ. Where the robot has no
  // mobility it does not move.
  double dissipated() {
    const auto own = ImpedanceNumbers{numbers.data(), e.size()}.parts();
    s = own.D.lazyProduct(e_dot);
    double power = s.dot(e_dot);
    if (!(own.ratio[0] > 0.0)) return power;
    factor_stiffness(own.K, C, V);
    factor_stiffness(G, B, V);
    Z = C.transpose().lazyProduct(B);  // Z Zᵀ = Cᵀ G C
    orthogonalise_rows(Z, V);          // the norms of its rows are frequencies
    s = C.transpose().lazyProduct(e_dot);
    along = V.lazyProduct(s);
    const double most = greatest(Z.rowwise().squaredNorm());
    for (Index k = 0; k < along.size(); ++k) {
      const double square = Z.row(k).squaredNorm();
      if (square > rounding * most)
        power += 2.0 * own.ratio[0] * along[k] * along[k] / std::sqrt(square);
    }
    return power;
  }
};

}  // namespace hsp
