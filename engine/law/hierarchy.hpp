// Strict priorities: the law for levels of tasks that may conflict.
//
//   Q_0 = W⁻¹,   G_k = J_k Q_{k-1} J_kᵀ                                   `open_level`
//   a ← a + Q_{k-1} J_kᵀ χ(G_k) (a_k - J_k'v - J_k a)                      `add_level`
//   Q_k = Q_{k-1} - Q_{k-1} J_kᵀ χ(G_k) J_k Q_{k-1}                      `close_level`
//
// Each level acts in the null space of the levels above. Those stay exact, whatever the lower
// levels command. The field is the last level: with P = Q_K W, J_a the stack of all levels, and w
// any solution of J_aᵀ w = W(I - P)x, found by going back through them,
//
//   φ_N = Q_K [ W(g' + K_N e_N) - J_a'ᵀ w + W'(x - e_N/2) ],   e_N = P x,  x = g - v
//
// so that V' = -e_NᵀW K_N e_N as long as the stack keeps its rank, conflicts included:
// `add_null_space`. How far each inverse χ(G_k) is bounded is the edge's,
// `edge/damped_levels.hpp`, which goes through the levels.
//
// If the stack has full rank, this equals the law of `law.hpp` up to rounding. That law is then
// used, because it needs a tenth of the time. The smallest singular value of the stack is a lower
// bound for those of all levels (Schur complements interlace), so both give the same result where
// one replaces the other. docs/law.md, Priorities.
#pragma once
#include "law.hpp"

namespace hsp {

// Projectors of the levels.
template <template <int...> class As> struct Projectors {
  As<'n', 'n'> Q;          // null space of the last level, Q_K = P W⁻¹
  As<'n', 'm'> QJ;         // Q_{k-1} J_kᵀ of all levels side by side
  As<'m', 'm'> G_inverse;  // χ(G_k) of all levels along the diagonal
};

// Q = W⁻¹ = (L Lᵀ)⁻¹
template <class L, class Q> void invert_metric(const L& factor, Q& inverse) {
  inverse.setIdentity();
  for (Index i = 0; i < inverse.rows(); ++i) {
    auto row = inverse.row(i).transpose();
    solve_lower(factor, row);
    solve_lower_transposed(factor, row);
  }
}

// Write Q Jᵀ and D⁻¹ G D⁻¹ = Σ x_r V_r V_rᵀ, with G = J Q Jᵀ, D the diagonal of the rows' units, and
// V_r the rows of V; return the smallest x. G is used.
template <class J, class Q, class D, class QJ, class G, class V, class X>
double open_level(const J& jacobian, const Q& projector, const D& units, QJ&& product, G&& gram,
                  V&& turned, X&& x) {
  product.noalias() = projector.lazyProduct(jacobian.transpose());
  gram.noalias() = jacobian.lazyProduct(product);
  for (Index p = 0; p < gram.rows(); ++p)
    for (Index k = 0; k <= p; ++k) gram(k, p) = gram(p, k) /= units[p] * units[k];
  // G is symmetric and not negative: its rows' lengths become its eigenvalues.
  orthogonalise_rows(gram, turned);
  x = gram.rowwise().norm();
  return x.size() ? x.minCoeff() : std::numeric_limits<double>::infinity();
}

// D⁻¹ χ(D⁻¹ G D⁻¹) D⁻¹: G⁻¹ where all x are above threshold², and bounded below.
template <class V, class X, class D, class Out>
void write_bounded_inverse(const V& turned, const X& x, double threshold, const D& units,
                           Out&& inverse) {
  const double floor = threshold * threshold;
  inverse.setZero();
  for (Index r = 0; r < x.size(); ++r) {
    const double q = x[r] >= floor ? 1.0 / x[r] : (2.0 - x[r] / floor) / floor;
    inverse.noalias() += q * turned.row(r).transpose().lazyProduct(turned.row(r));
  }
  for (Index p = 0; p < inverse.rows(); ++p)
    for (Index k = 0; k < inverse.cols(); ++k) inverse(p, k) /= units[p] * units[k];
}

// Add Q Jᵀ χ(G) times the level's residual to a.
template <class QJ, class G, class Rest, class Row, class A>
void add_level(const QJ& product, const G& inverse, const Rest& rest, Row&& row, A& a) {
  row.noalias() = inverse * rest;
  a.noalias() += product * row;
}

// Q ← Q - Q Jᵀ χ(G) J Q, which stays symmetric.
template <class Q, class QJ, class G, class Row>
void close_level(Q& projector, const QJ& product, const G& inverse, Row&& row) {
  for (Index i = 0; i < projector.rows(); ++i) {
    row.noalias() = inverse.transpose() * product.row(i).transpose();
    for (Index j = 0; j <= i; ++j) {
      projector(i, j) -= product.row(j).dot(row.transpose());
      projector(j, i) = projector(i, j);
    }
  }
}

struct LevelMemory {
  Scratch<'n'> x, Wx, Y, bent, rate;
  Scratch<'m'> row, w;
  void prepare(const Sizes& size) {
    for (auto* each : {&x, &Wx, &Y, &bent, &rate}) each->prepare(size);
    for (auto* each : {&row, &w}) each->prepare(size);
  }
};

// Write e_N, and add φ_N to a; all levels are closed.
template <class Ends, class E, class A>
void add_null_space(const LawInput& in, const Ends& ends, const Projectors<InOut>& projectors,
                    LevelMemory& memory, E& e_N, A& a) {
  const auto& [J, J_dot, error, error_rate, a_x] = in.task;
  const auto& [g, g_dot] = in.field;
  const auto& [W, L, W_dot] = in.metric;
  const auto& [Q, QJ, G_inverse] = projectors;
  auto& [x, Wx, Y, bent, rate, row, w] = memory;

  // x = g - v, and the levels' parts of it and of its motion
  x = g - in.v;
  Wx.noalias() = W * x;
  Y.setZero();
  bent.setZero();
  for (Index level = ends.size() - 1; level >= 0; --level) {
    const Index start = level > 0 ? ends[level - 1] : 0, size = ends[level] - start;
    auto row_k = row.head(size), w_k = w.head(size);
    x = Wx - Y;
    row_k.noalias() = QJ.middleCols(start, size).transpose() * x;
    w_k.noalias() = G_inverse.block(start, start, size, size) * row_k;
    Y.noalias() += J.middleRows(start, size).transpose() * w_k;
    bent.noalias() += J_dot.middleRows(start, size).transpose() * w_k;
  }
  x = g - in.v;

  // e_N = Q W x, and φ_N of equation (13) over the metric
  e_N.noalias() = Q * Wx;
  if (!in.controls) return;
  rate = g_dot;
  rate.noalias() += in.K_N * e_N;
  Y = -bent;
  Y.noalias() += W * rate;
  if (in.form == VARYING) {
    rate = x - 0.5 * e_N;
    Y.noalias() += W_dot * rate;
  }
  a.noalias() += Q * Y;
}

}  // namespace hsp
