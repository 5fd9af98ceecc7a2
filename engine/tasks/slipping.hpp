// A spring with a bounded force, which slips at its largest force.
//
// Let each group of rows g, such as the position, exert no more than F_g. The spring slips by x, as
// against a friction force of F_g in every direction, and its force is K (e - x):
//
//   U(e) = min_x ½ (e - x)ᵀ K (e - x) + Σ F_g |x_g|
//   s(e) = ∂U/∂e = S e,    S = (K⁻¹ + diag(c))⁻¹ = C (I + Cᵀ diag(c) C)⁻¹ Cᵀ,    c ≥ 0
//
// with K = C Cᵀ, which may be without stiffness along some directions, and one number c in each
// group, 0 unless |s_g| = F_g. U is convex, ½ eᵀK e where no force is at its bound, and grows
// linearly far away, so that the bounded force is conservative for every stiffness. Each c is where
// a Newton iteration on 1/|s_g| ends, as for the radius of a trust region: one step if the group's
// stiffness is one number.
#pragma once
#include <cmath>
#include <hsp/indices.hpp>
#include <hsp/kind.hpp>
#include <hsp/linalg.hpp>
#include <limits>

namespace hsp {

// The numbers of an impedance.
struct Impedance {
  In<'m', 'm'> K, D;             // stiffness, damping; symmetric, not negative
  In<'m'> ratio, inverse_force;  // ζ, the same for all rows; 1/F of each row, 0 for no bound
};

// Throws unless groups of one row or more divide the rows.
inline void check_groups(const Ints<'g'>& ends, Index rows) {
  check_ends("ends", ends, rows);
  for (Index g = 0; g < ends.size(); ++g)
    if (ends[g] == (g == 0 ? 0 : ends[g - 1])) throw std::invalid_argument("a group has no rows");
}

// A group's rows, and F_g, inf for no bound.
struct Group {
  Index first, size;
  double most;

  template <class Impedance_>
  Group(Index g, const Ints<'g'>& ends, const Impedance_& impedance)
      : first(g == 0 ? 0 : ends[g - 1]), size(ends[g] - first) {
    const double inverse = impedance.inverse_force[first];
    most = inverse > 0.0 ? 1.0 / inverse : std::numeric_limits<double>::infinity();
  }

  template <class X> auto of(X& x) const { return x.segment(first, size); }
};

// K = C Cᵀ of a symmetric K that is not negative, by its eigenvectors; `turned` is used.
template <class K, class C, class V>
void factor_stiffness(const K& stiffness, C& factor, V& turned) {
  factor = stiffness;
  orthogonalise_rows(factor, turned);  // V K = diag(λ) V
  for (Index k = 0; k < factor.rows(); ++k) turned.row(k) *= std::sqrt(factor.row(k).norm());
  factor = turned.transpose();
}

// The secant stiffness S of an error, with its memory.
struct BoundedStiffness {
  Scratch<'m', 'm'> C, V, L;
  Scratch<'m'> s, change, part;
  Scratch<'g'> c;

  // Write S where a bound acts; return whether one does, else S is K, and is not written.
  template <class Impedance_, class E, class Out_>
  bool write(const Impedance_& impedance, const Ints<'g'>& ends, const E& e, Out_& S) {
    s = impedance.K.lazyProduct(e);
    bool acts = false;
    for (Index g = 0; g < ends.size(); ++g) {
      const Group group(g, ends, impedance);
      acts = acts || group.of(s).norm() > group.most;
    }
    if (!acts) return false;
    factor_stiffness(impedance.K, C, V);
    c.setZero();
    bool settled = false;
    for (int sweep = 0; sweep < steps && !settled; ++sweep) {  // where K couples the groups
      settled = true;
      for (Index g = 0; g < ends.size(); ++g)
        settled = bound(Group(g, ends, impedance), g, ends, e) && settled;
    }
    factorise(ends);
    V = C.transpose();
    for (Index k = 0; k < V.cols(); ++k) solve_factored(V.col(k));
    S = C.lazyProduct(V);
    return true;
  }

 private:
  static constexpr double tolerance = 1e-11;  // of |s_g|, relative to F_g
  static constexpr int steps = 40;

  // Newton's iteration on 1/|s_g|, which is nearly linear in c_g; returns whether it has converged.
  template <class E> bool bound(const Group& group, Index g, const Ints<'g'>& ends, const E& e) {
    if (std::isinf(group.most)) return true;
    for (int step = 0; step < steps; ++step) {
      factorise(ends);
      s = e;
      apply(s);
      const double n = group.of(s).norm(), relative = n / group.most;
      if (relative <= 1.0 + tolerance && (c[g] == 0.0 || relative >= 1.0 - tolerance))
        return step == 0;
      change.setZero();
      group.of(change) = group.of(s);
      apply(change);  // -∂s/∂c_g
      const double slope = group.of(s).dot(group.of(change));
      c[g] = std::max(c[g] + (relative - 1.0) * n * n / slope, 0.0);
    }
    return false;
  }

  // L Lᵀ = I + Cᵀ diag(c) C
  void factorise(const Ints<'g'>& ends) {
    V = C;
    for (Index g = 0, i = 0; g < ends.size(); ++g)
      for (; i < ends[g]; ++i) V.row(i) *= c[g];
    L = C.transpose().lazyProduct(V);
    L.diagonal().array() += 1.0;
    cholesky(L, L);
  }

  // x = S x
  void apply(Scratch<'m'>& x) {
    part = C.transpose().lazyProduct(x);
    solve_factored(part);
    x = C.lazyProduct(part);
  }

  template <class X> void solve_factored(X&& x) const {
    solve_lower(L, x);
    solve_lower_transposed(L, x);
  }
};

struct SpringStiffness {
  static constexpr const char* doc = "S, the stiffness of a spring whose force is bounded.";
  Impedance impedance;
  Ints<'g'> ends;  // where each group of rows ends
  In<'m'> e;
  Out<'m', 'm'> S;
  BoundedStiffness bounded;

  void check() const { check_groups(ends, e.size()); }
  void operator()() {
    if (!bounded.write(impedance, ends, e, S)) S = impedance.K;
  }
};

struct SpringPulls {
  static constexpr const char* doc = "(K e)_i/F_g; 0 where there is no bound.";
  Impedance impedance;
  Ints<'g'> ends;
  In<'m'> e;
  Out<'m'> pulls;

  void check() const { check_groups(ends, e.size()); }
  void operator()() {
    pulls = impedance.K.lazyProduct(e);
    for (Index g = 0; g < ends.size(); ++g) {
      const Group group(g, ends, impedance);
      group.of(pulls) /= group.most;
    }
  }
};

}  // namespace hsp
