// Linear algebra as separate calls, for tests.
#pragma once
#include <hsp/kind.hpp>
#include <hsp/linalg.hpp>
#include <stdexcept>

namespace hsp {

struct Cholesky {
  static constexpr const char* doc = "Write L of A = L Lᵀ; return whether A is positive definite.";
  In<'n', 'n'> A;
  Out<'n', 'n'> L;

  bool operator()() { return cholesky(A, L); }
};

struct SolveLower {
  static constexpr const char* doc = "Overwrite x by L⁻¹ x.";
  In<'n', 'n'> L;
  InOut<'n'> x;

  void operator()() { solve_lower(L, x); }
};

struct SolveLowerTransposed {
  static constexpr const char* doc = "Overwrite x by L⁻ᵀ x.";
  In<'n', 'n'> L;
  InOut<'n'> x;

  void operator()() { solve_lower_transposed(L, x); }
};

struct OrthonormaliseRows {
  static constexpr const char* doc =
      "Write Q = X J with orthonormal rows; return a lower bound of J's smallest singular value.";
  In<'m', 'n'> J;
  Out<'m', 'n'> Q;
  Out<'m', 'm'> X;

  double operator()() { return orthonormalise_rows(J, Q, X); }
};

struct OrthogonaliseRows {
  static constexpr const char* doc = "Overwrite Y by U Y, whose rows are orthogonal.";
  InOut<'m', 'n'> Y;
  Out<'m', 'm'> U;

  void operator()() { orthogonalise_rows(Y, U); }
};

struct TriangulariseRows {
  static constexpr const char* doc =
      "Overwrite the lower triangle of Y by Y H's, H orthogonal; return det(Y Yᵀ).";
  InOut<'m', 'n'> Y;

  void check() const {
    if (Y.rows() > Y.cols()) throw std::invalid_argument("Y has more rows than columns");
  }
  double operator()() { return triangularise_rows(Y); }
};

struct SmallestSingularValueBound {
  static constexpr const char* doc =
      "Return a lower bound of the smallest singular value of B, for Q = X B.";
  In<'m', 'm'> X;

  double operator()() { return smallest_singular_value_bound(X); }
};

}  // namespace hsp
