// Solves with the Gram matrix G = J W⁻¹ Jᵀ of a few rows.
#pragma once
#include <hsp/linalg.hpp>

namespace hsp {

// X ← (L Lᵀ)⁻¹ X, of a lower triangular L: row by row, as X lies.
template <class L, class X> void solve_gram(const L& factor, X& x) {
  const Index k = factor.rows();
  for (Index i = 0; i < k; ++i) {
    for (Index p = 0; p < i; ++p) x.row(i) -= factor(i, p) * x.row(p);
    x.row(i) /= factor(i, i);
  }
  for (Index i = k - 1; i >= 0; --i) {
    for (Index p = i + 1; p < k; ++p) x.row(i) -= factor(p, i) * x.row(p);
    x.row(i) /= factor(i, i);
  }
}

// Y = G⁻¹X and Y' = G⁻¹(X' - G'Y), with G = L Lᵀ.
template <class L, class G, class X, class Y>
void solve_with_rate(const L& factor, const G& gram_dot, const X& x, const X& x_dot, Y& y,
                     Y& y_dot) {
  y = x;
  solve_gram(factor, y);
  y_dot = x_dot - gram_dot.lazyProduct(y);
  solve_gram(factor, y_dot);
}

}  // namespace hsp
