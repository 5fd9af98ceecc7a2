// The weighted pseudo-inverse, exact away from singularities and bounded through them.
//
//   J# = W⁻¹Jᵀ χ(J W⁻¹Jᵀ) = L⁻ᵀ B#,    B = J L⁻ᵀ,    W = L Lᵀ
//
// In the whitened Jacobian B every metric is the Euclidean one, and B# = Qᵀ X is that of
// `bounded_inverse`: it stays in these two factors, which the law multiplies by one after the
// other. docs/law.md, Near singularities.
#pragma once
#include "../metrics/raise.hpp"

namespace hsp {

// The two factors of a pseudo-inverse, B# = Qᵀ X.
template <template <int...> class As> struct Factors {
  As<'m', 'n'> Q;
  As<'m', 'm'> X;
};

// B = J L⁻ᵀ.
template <class J, class L, class B>
void whiten(const J& jacobian, const L& factor, int form, B& whitened) {
  whitened = jacobian;
  if (form != IDENTITY) solve_rows(factor, whitened);
}

// Products with J#, given its factors.
template <class Q, class X, class L> struct PseudoInverse {
  const Q& q;
  const X& factor;
  const L& L_metric;
  int form;

  // y = J# x = L⁻ᵀ Qᵀ X x, the smallest motion that achieves x.
  template <class In, class Part, class Out> void apply(const In& x, Part& part, Out&& y) const {
    part.noalias() = factor * x;
    y.noalias() = q.transpose() * part;
    if (form != IDENTITY) solve_lower_transposed(L_metric, y);
  }

  // w = J#ᵀ y = Xᵀ Q L⁻¹ y; y is overwritten by L⁻¹ y.
  template <class In, class Part, class Out>
  void apply_transposed(In& y, Part& part, Out& w) const {
    if (form != IDENTITY) solve_lower(L_metric, y);
    part.noalias() = q * y;
    w.noalias() = factor.transpose() * part;
  }
};
template <class Q, class X, class L>
PseudoInverse(const Q&, const X&, const L&, int) -> PseudoInverse<Q, X, L>;

}  // namespace hsp
