// The impedance of a task as an input: its numbers change as on the time line of a controller in
// Python, and wait where they would add energy; see `FollowImpedance`.
#pragma once
#include "../tasks/follow_impedance.hpp"
#include "evolve.hpp"

namespace hsp {

struct EvolveImpedance {
  static constexpr const char* doc =
      "The numbers of an impedance that are planned for now; they are in force unless those in "
      "force wait.";
  Evolve planned;
  In<'m', 'm'> G;  // Λ⁻¹ of the last step
  In<1> period;    // [s]
  Ints<1> waits;
  InOut<'r', 'm'> numbers;  // in force
  Scratch<'n'> wanted;      // checked, and then planned
  Scratch<'m', 'm'> K, C, B, V, Z;

  void check() const {
    planned.check();
    if (numbers.rows() != 2 * numbers.cols() + 2 || planned.x.size() != numbers.size())
      throw std::invalid_argument("numbers has 2 m + 2 rows, and is as large as x");
  }

  void operator()(double t) {
    planned(t);
    if (!waits[0]) flat() = planned.x;
  }

  // Some numbers of the impedance that is planned last become others; whether that may be.
  template <class Values> bool permits(Index first, Index size, const Values& values) {
    if (!values.allFinite()) return false;
    wanted = planned.last();
    // One number for each row of a diagonal, or all that follow one another.
    if (values.size() == 1) wanted.segment(first, size).setConstant(values[0]);
    else wanted.segment(first, size) = values;
    return is_impedance() && is_stable();
  }
  bool then(double t, double ramp) { return planned.then(t, ramp, wanted); }

 private:
  static constexpr double rounding = 1e-9;  // of a matrix that was typed or rotated

  Eigen::Map<Vector> flat() { return {numbers.data(), numbers.size()}; }
  ImpedanceNumbers::Parts own() const {
    return ImpedanceNumbers{wanted.data(), numbers.cols()}.parts();
  }

  // The checks of `Impedance` in Python.
  bool is_impedance() {
    const auto [stiffness, damping, ratio, inverse_force] = own();
    if (!is_semidefinite(stiffness) || !is_semidefinite(damping)) return false;
    if (!(ratio[0] >= 0.0 && ratio[0] <= planned.most)) return false;
    if (ratio[0] > 0.0) return !stiffness.isZero(0.0);
    // Every direction that is stiff is damped: it would oscillate for ever.
    B = damping;
    orthogonalise_rows(B, V);  // V D = diag(λ) V
    const double most = greatest(B.rowwise().norm()), stiff = greatest(stiffness.cwiseAbs());
    for (Index k = 0; k < B.rows(); ++k) {
      if (B.row(k).norm() > rounding * most) continue;
      Z.col(0) = stiffness.lazyProduct(V.row(k).transpose());
      if (greatest(Z.col(0).cwiseAbs()) > rounding * stiff) return false;
    }
    return true;
  }

  // Symmetric, and with no eigenvalue below zero, but for rounding.
  template <class Given> bool is_semidefinite(const Given& given) {
    const double size = greatest(given.cwiseAbs());
    if (size == 0.0) return true;
    if (!(size <= planned.most &&
          greatest((given - given.transpose()).cwiseAbs()) <= rounding * size))
      return false;
    K = given;
    K.diagonal().array() += rounding * size;
    return cholesky(K, K);
  }

  // Conditions of a stable scalar error at the robot's state: ω² h² < 4, 2 ζ ω h < 2, λ(G D) h < 2.
  bool is_stable() {
    const auto [stiffness, damping, ratio, inverse_force] = own();
    const double h = period[0], square = largest(stiffness), rate = largest(damping);
    return square * h * h < 4.0 && ratio[0] * std::sqrt(square) * h < 1.0 && rate * h < 2.0;
  }

  // The largest eigenvalue of G X.
  template <class Given> double largest(const Given& given) {
    factor_stiffness(given, C, V);
    factor_stiffness(G, B, V);
    Z = C.transpose().lazyProduct(B);
    orthogonalise_rows(Z, V);
    return greatest(Z.rowwise().squaredNorm());
  }
};

struct EvolveAhead {
  static constexpr const char* doc = "What an input is at the end of the period.";
  Evolve planned;
  In<1> period;  // [s]

  void check() const { planned.check(); }
  void operator()(double t) { planned(t + period[0]); }
};

}  // namespace hsp
