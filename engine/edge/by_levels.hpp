// The contribution of the first levels to the law, while a limit is active, and what their errors
// alone command: J# f of the exact law, f = Kp s(e). In an equilibrium only that is left of it.
#pragma once
#include "resolve.hpp"

namespace hsp {

struct ByLevels {
  static constexpr const char* doc =
      "Write the part of a_damped due to the first k levels, for each level k but the last, and "
      "the tasks' part of a, after `SelfMotions`; and J# f of the first k levels.";
  In<'m', 'n'> J, J_dot;
  In<'m'> a_x, demand;  // demand: f
  In<'n', 'n'> L;
  int form;
  In<'n'> v;
  Projectors<In> projectors;  // of the levels, if the damped law bounds an inverse
  Ints<'l'> ends;             // where each level's rows end
  Ints<1> edge_level;
  In<'n'> a, self_motion;  // φ_N of it
  Out<'l', 'n'> by_levels, at_rest;
  Factors<Out> factors;  // Q = X J L⁻ᵀ, with orthonormal rows, and X lower triangular
  Scratch<'m', 'n'> B;
  Scratch<'m'> missing, part;
  Scratch<'n'> sum, level;

  void check() const { check_ends("ends", ends, J.rows()); }
  void operator()() {
    const Index last = ends.size() - 1;
    if (last < 0) return;
    whiten(J, L, form, B);
    orthonormalise_rows(B, factors.Q, factors.X);
    write_exact(demand, last + 1, at_rest);
    if (last > 0) {
      missing = a_x;
      missing.noalias() -= J_dot * v;
      edge_level[0] == 0 ? write_exact(missing, last, by_levels) : write_damped(last);
    }
    by_levels.row(last) = (a - self_motion).transpose();
  }

 private:
  // X is lower triangular: the first k levels of the exact law are those of a law without the
  // others.
  template <class Demanded, class Rows>
  void write_exact(const Demanded& demanded, Index levels, Rows& out) {
    part.noalias() = factors.X * demanded;
    sum.setZero();
    for (Index k = 0, start = 0; k < levels; start = ends[k++]) {
      const Index rows = ends[k] - start;
      sum.noalias() += factors.Q.middleRows(start, rows).transpose() * part.segment(start, rows);
      level = sum;
      if (form != IDENTITY) solve_lower_transposed(L, level);
      out.row(k) = level.transpose();
    }
  }

  void write_damped(Index last) {
    sum.setZero();
    for (Index k = 0, start = 0; k < last; start = ends[k++]) {
      const Index rows = ends[k] - start;
      auto rest = missing.segment(start, rows), row = part.head(rows);
      rest.noalias() -= J.middleRows(start, rows) * sum;
      add_level(projectors.QJ.middleCols(start, rows),
                projectors.G_inverse.block(start, start, rows, rows), rest, row, sum);
      by_levels.row(k) = sum.transpose();
    }
  }
};

}  // namespace hsp
