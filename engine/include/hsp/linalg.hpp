// Dense linear algebra for small matrices, without allocations.
//
// Decompositions of a wide B (m, n) work on its rows, as NumPy stores matrices. The bounded
// inverse is B# = Qᵀ X: away from rank loss Q = X B has orthonormal rows and X is lower
// triangular; near it Q = U B has orthogonal rows, and X = q(s²) U inverts the spectrum.
#pragma once
#include <cmath>
#include <hsp/view.hpp>
#include <limits>

namespace hsp {

// The greatest of numbers that are not negative; of none 0, where Eigen would read memory.
template <class Numbers> double greatest(const Numbers& x) { return x.size() ? x.maxCoeff() : 0.0; }

// x ← L⁻¹ x and x ← L⁻ᵀ x for a lower triangular L.
template <class L, class X> void solve_lower(const L& factor, X&& x) {
  factor.template triangularView<Eigen::Lower>().solveInPlace(x);
}
template <class L, class X> void solve_lower_transposed(const L& factor, X&& x) {
  factor.transpose().template triangularView<Eigen::Upper>().solveInPlace(x);
}

// X ← X L⁻ᵀ and X ← X L⁻¹: each row by itself.
template <class L, class X> void solve_rows(const L& factor, X&& rows) {
  for (Index i = 0; i < rows.rows(); ++i) solve_lower(factor, rows.row(i).transpose());
}
template <class L, class X> void solve_rows_transposed(const L& factor, X&& rows) {
  for (Index i = 0; i < rows.rows(); ++i) solve_lower_transposed(factor, rows.row(i).transpose());
}

// L of A = L Lᵀ, of which the lower triangle is read; whether A is positive definite. (Eigen's
// LLT has its own memory; this writes into the caller's.)
template <class A, class L> bool cholesky(const A& matrix, L& factor) {
  const Index n = matrix.rows();
  for (Index j = 0; j < n; ++j) {
    const double pivot = matrix(j, j) - factor.row(j).head(j).squaredNorm();
    if (!(pivot > 0.0)) return false;
    factor(j, j) = std::sqrt(pivot);
    for (Index i = j + 1; i < n; ++i) {
      factor(i, j) =
          (matrix(i, j) - factor.row(i).head(j).dot(factor.row(j).head(j))) / factor(j, j);
      factor(j, i) = 0.0;
    }
  }
  return true;
}

namespace detail {

// Normalise row j and subtract its component from later rows, X alongside; its square before.
template <class Q, class X> double project_out_row(Q& rows, X& factor, Index j) {
  const double square = rows.row(j).squaredNorm();
  const double scale = square > 0.0 ? 1.0 / std::sqrt(square) : 0.0;
  rows.row(j) *= scale;
  factor.row(j).head(j + 1) *= scale;
  for (Index k = j + 1; k < rows.rows(); ++k) {
    const double component = rows.row(j).dot(rows.row(k));
    rows.row(k) -= component * rows.row(j);
    factor.row(k).head(j + 1) -= component * factor.row(j).head(j + 1);
  }
  return square;
}

// Rotate rows p and q so that they are orthogonal; whether they were not.
template <class Y, class U> bool rotate_rows(Y& rows, U& turned, Index p, Index q) {
  const double alpha = rows.row(p).squaredNorm(), beta = rows.row(q).squaredNorm();
  const double gamma = rows.row(p).dot(rows.row(q));
  if (std::abs(gamma) <= 1e-15 * std::sqrt(alpha * beta) || gamma * gamma == 0.0) return false;
  // The tangent of the smaller angle, where a quotient of the two might overflow.
  const double apart = beta - alpha, twice = 2.0 * gamma;
  double t = twice / (std::abs(apart) + std::sqrt(apart * apart + twice * twice));
  if (apart < 0.0) t = -t;
  const double c = 1.0 / std::sqrt(1.0 + t * t), s = c * t;
  const auto rotate = [&](auto&& x, auto&& y) {
    for (Index i = 0; i < x.size(); ++i) {
      const double old = x[i];
      x[i] = c * old - s * y[i];
      y[i] = s * old + c * y[i];
    }
  };
  rotate(rows.row(p), rows.row(q));
  if (turned.rows() > 0) rotate(turned.row(p), turned.row(q));
  return true;
}

}  // namespace detail

// Write a lower triangular X (m, m), and Q = X J (m, n) with orthonormal rows; return 1/‖X‖_F, a
// lower bound of J's smallest singular value, too small by a factor of √m at most; 0 if a row
// became zero, inf without rows.
//
// Modified Gram-Schmidt: each row is normalised, then its component is subtracted from the rows
// after it. If a row loses nine tenths of its length or more, all rows are orthogonalised a
// second time ("twice is enough", Giraud et al. 2005), so that Q is orthonormal to rounding. A
// row that becomes zero leaves zeros in Q and X.
template <class J, class Q, class X> double orthonormalise_rows(const J& rows, Q& q, X& factor) {
  const Index m = rows.rows();
  q = rows;
  factor.setIdentity();
  bool cancelled = false;
  for (Index j = 0; j < m; ++j)
    cancelled |= detail::project_out_row(q, factor, j) < 0.01 * rows.row(j).squaredNorm();
  if (cancelled)
    for (Index j = 0; j < m; ++j) detail::project_out_row(q, factor, j);
  double total = 0.0;
  for (Index j = 0; j < m; ++j) {
    if (factor(j, j) == 0.0) return 0.0;
    total += factor.row(j).head(j + 1).squaredNorm();
  }
  return total > 0.0 ? 1.0 / std::sqrt(total) : std::numeric_limits<double>::infinity();
}

// Overwrite the lower triangle of Y (m, n), m ≤ n, with Y H's, and return det(Y Yᵀ). H is a
// product of Householder's reflections: Y H is zero elsewhere, and has Y's singular values. The
// rest of Y is scratch memory.
template <class Y> double triangularise_rows(Y& rows) {
  const Index m = rows.rows(), n = rows.cols();
  double product = 1.0;
  for (Index j = 0; j < m; ++j) {
    auto tail = rows.row(j).tail(n - j);
    const double first = tail[0], square = tail.squaredNorm();
    product *= square;
    if (!(square > 0.0)) continue;
    const double length = std::sqrt(square), diagonal = first > 0.0 ? -length : length;
    tail[0] = first - diagonal;
    const double scale = 1.0 / (length * (length + std::abs(first)));
    for (Index k = j + 1; k < m; ++k) {
      const double component = scale * tail.dot(rows.row(k).tail(n - j));
      rows.row(k).tail(n - j) -= component * tail;
    }
    rows(j, j) = diagonal;
  }
  return product;
}

// 1/√‖X Xᵀ‖_F for a lower triangular X of Q = X B: a lower bound of B's smallest singular value.
template <class X> double smallest_singular_value_bound(const X& factor) {
  double square = 0.0;
  for (Index i = 0; i < factor.rows(); ++i)
    for (Index j = 0; j <= i; ++j) {
      const double dot = factor.row(i).head(j + 1).dot(factor.row(j).head(j + 1));
      square += (i == j ? 1.0 : 2.0) * dot * dot;
    }
  return 1.0 / std::sqrt(std::sqrt(square));
}

// Eigenvalues of a symmetric matrix; its memory is that of a size.
using SymmetricSpectrum = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>;

// The smallest singular value s of B, from X of Q = X B: 1/s² is the largest eigenvalue of X Xᵀ,
// and the most accurate one. `square` is scratch memory. Rounding in X is that of s, ε‖B‖.
template <class X, class S>
double smallest_singular_value(const X& factor, S& square, SymmetricSpectrum& spectrum) {
  if ((factor.diagonal().array() == 0.0).any()) return 0.0;  // a row became zero
  square.noalias() = factor.lazyProduct(factor.transpose());
  spectrum.compute(square, Eigen::EigenvaluesOnly);
  return 1.0 / std::sqrt(greatest(spectrum.eigenvalues()));
}

// Overwrite Y (m, n) with U Y, whose rows are orthogonal; U (m, m) is orthogonal, and is not
// written if it has no rows.
//
// One-sided Jacobi, in rounds of pairs that share no row. The norms of the new rows are the
// singular values of Y; small ones have high relative accuracy (Demmel and Veselić 1992). Y may
// be rank-deficient.
template <class Y, class U> void orthogonalise_rows(Y& rows, U& turned) {
  const Index m = rows.rows();
  turned.setIdentity();
  const Index turning = m - 1 + m % 2;  // with an even m the last row is in a pair of each round
  for (int sweep = 0; sweep < 30; ++sweep) {  // about six are needed
    bool rotated = false;
    for (Index r = 0; r < turning; ++r) {
      if (turning < m) rotated |= detail::rotate_rows(rows, turned, r, turning);
      for (Index k = 1; k < (turning + 1) / 2; ++k) {
        const Index p = r >= k ? r - k : r - k + turning;
        const Index q = r + k < turning ? r + k : r + k - turning;
        rotated |= detail::rotate_rows(rows, turned, std::min(p, q), std::max(p, q));
      }
    }
    if (!rotated) return;
  }
}

// Write Q = X B as `orthonormalise_rows` does, so that B⁺ = Qᵀ X; return whether every singular
// value of B is above the threshold. `square` (m, m) is used.
//
// The largest singular value of X is 1/s for the smallest s of B. Where bounds of it do not decide,
// a factorisation does: no spectrum is needed.
template <class B, class Q, class X, class S>
bool exact_inverse(const B& wide, double threshold, Q& q, X& factor, S& square) {
  double bound = orthonormalise_rows(wide, q, factor);
  if (bound == 0.0) return threshold <= 0.0;
  if (bound < threshold) bound = smallest_singular_value_bound(factor);
  if (bound >= threshold) return true;
  square.setZero();
  square.diagonal().setConstant(1.0 / (threshold * threshold));
  for (Index i = 0; i < factor.rows(); ++i)
    for (Index j = 0; j <= i; ++j)
      square(i, j) -= factor.row(i).head(j + 1).dot(factor.row(j).head(j + 1));
  return cholesky(square, square);  // of 1/threshold² - X Xᵀ
}

// Write the factors of B# = Bᵀ q(B Bᵀ) = Qᵀ X by the spectrum; return whether it was damped.
//
// q(x) = 1/x for x ≥ threshold² and (2 - x/threshold²)/threshold² below it: exactly the
// pseudo-inverse while every singular value of B is above the threshold, continuously
// differentiable, and bounded: ‖B#‖ ≤ 1.09/threshold. B has the shape (m, n), m ≤ n.
template <class B, class Q, class X>
bool damped_inverse(const B& wide, double threshold, Q& q, X& factor) {
  q = wide;
  orthogonalise_rows(q, factor);
  const double floor = threshold * threshold;
  bool damped = false;
  for (Index k = 0; k < q.rows(); ++k) {
    const double x = q.row(k).squaredNorm();
    factor.row(k) *= x >= floor ? 1.0 / x : (2.0 - x / floor) / floor;
    damped |= x < floor;
  }
  return damped;
}

// The same, but without the spectrum where it is exact; `square` (m, m) is scratch memory.
template <class B, class Q, class X, class S>
bool bounded_inverse(const B& wide, double threshold, Q& q, X& factor, S& square) {
  return !exact_inverse(wide, threshold, q, factor, square) &&
         damped_inverse(wide, threshold, q, factor);
}

}  // namespace hsp
