// Cost of deviations from the law's acceleration, level by level.
//
// The cost of a deviation δ is ½ δᵀH δ with H = Σ ρ_k (Lᵀδ·n_k)², over directions n_k that are
// orthonormal in whitened coordinates Lᵀδ. So H⁻¹ = J Jᵀ, with the columns L⁻ᵀ n_k / √ρ_k in J: no
// matrix is factorised.
//
// The cost below a level is a small part of the level's own, which grows with the level's error:
// priorities are strict where the errors are small. With a fixed tiny part, a hand that cannot
// reach its target would move the null space as far as limits permit for a negligible gain, from
// one bound of the efforts to the other between two periods. The cost is larger while a limit keeps
// the level from being met, see `edge/held_levels.hpp`.
//
// Levels of springs have no precedence: deviations below them have the same cost. With the mass
// matrix, their metric, the deviation then follows from Gauss's principle of least constraint:
// joints at active limits receive the reaction of mechanical stops, which does no work, so that a
// spring feeds no oscillation.
//
// With P_k the projector for the levels below k, P_0 = 1, a level has the share P_{k-1} - P_k of
// all motions, and the null space the rest, P_K. Their costs are ρ_k = ρ_N^t_k, t_1 = 0 to t_N = 1,
// and that of all is
//
//     log H = log ρ_N Σ t_k (P_{k-1} - P_k),      in whitened coordinates
//
// Away from singularities each share is a projector, and each n_k belongs to one level. Near one
// the law releases a part of a direction to the levels below, and so does H: it is a continuous
// function of the law's projectors.
//
// A limit that a self-motion meets costs a task that is met nothing: both, that release and the
// cost that grows with the error, are scaled by the slack λ of `edge/limit_share.hpp`.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/indices.hpp>
#include <hsp/linalg.hpp>
#include <hsp/records.hpp>

#include "../law/hierarchy.hpp"

namespace hsp {

// Costs of level k and then of the null space: ρ_k = ρ_N^t_k.
struct LevelCosts {
  Vector t, root;  // 1/√ρ

  void prepare(const Sizes& size) {
    t.setZero(size('l') + 1);
    root.setZero(size('l') + 1);
  }
};

struct Directions {
  static constexpr const char* doc =
      "Directions of the law's levels and of the null space, and the costs of deviating in each.";
  In<'m', 'n'> jacobian;  // of all tasks, level after level
  In<'n', 'n'> L;         // Cholesky factor of the metric
  std::int64_t form;      // metric's form
  Ints<'l'> ends;         // where each level's rows end
  Flags<'m'> springs;     // whether a row is that of a spring
  In<'m'> error;          // error e of all tasks
  double size;            // robot's size [m]
  std::int64_t first;     // first level that may deviate: 1 below contacts, else 0
  double least;           // least cost of a level relative to the one above it
  In<'l'> held;           // minimum costs below each level, see `HeldLevels`
  In<'l'> thresholds;     // singular value below which a direction belongs to a level in part
  In<'m'> units;          // D, in which singular values are
  Factors<In> factors;
  Projectors<In> projectors;
  Factors<In> exact;   // of the exact inverse, where μ < 1
  In<1> slack;         // λ
  Ints<1> edge_level;  // the first level whose inverse the damped law bounds; 0: none
  bool alone;          // whether the law resolves its one level at once, whatever happens
  Out<'n', 'n'> N;     // directions n_k as rows
  OutInts<1> kept;     // number of leading directions that belong to the first level alone
  Out<'n'> root;       // 1/√ρ of each
  LevelCosts costs;
  Scratch<'m', 'n'> B;  // whitened rows
  Scratch<'m', 'm'> square;
  Scratch<'n', 'n'> F, FQ, T, U;
  Scratch<'n', 'm'> FJ, FG;
  Scratch<'n'> remainders, shares;

  void check() const {
    check_ends("ends", ends, jacobian.rows());
    check_at_least("ends", ends.size(), alone ? 1 : 0);
  }
  void operator()() {
    write_costs();
    const Index levels = ends.size(), damped = edge_level[0];
    if (damped == 0) {
      write_exact_levels(factors.Q);
    } else if (slack[0] == 0.0) {
      write_exact_levels(exact.Q);
    } else if (alone) {
      complete(write_damped_level());
    } else {
      const Index count = write_levels(std::min(damped, levels));
      write_roots(count);
      complete(count);
      share_rest(count);
    }
  }

 private:
  // Cost below a level, of another level or the null space, relative to the level, for an error of
  // the robot's size; and its maximum.
  static constexpr double below_level = 1.0, below_last = 0.2, most = 0.1;

  // Singular value, relative to the threshold, below which rounding determines a direction; the
  // null space has all of it but 2e-6.
  static constexpr double lost = 1e-3;

  double free_root() const { return costs.root[costs.root.size() - 1]; }

  // t and 1/√ρ of each level and of the null space.
  void write_costs() {
    const Index last = ends.size();
    const bool standing = first > 0;
    double log_cost = 0.0;
    Index start = 0;
    for (Index k = 0; k < last; ++k) {
      costs.t[k] = log_cost;
      const Index rows = ends[k] - start;
      const bool is_spring = springs.segment(start, rows).all();
      const double of_error = k < last - 1 ? below_level : below_last;
      const double length = error.segment(start, rows).norm();
      // A standing robot keeps its balance at any cost.
      const double far = slack[0] * std::min(of_error * length / size, most);
      const double below = standing ? 0.0 : std::max(far, held[k]);
      if (k >= first && (standing || !is_spring))
        log_cost += std::log(std::clamp(below, least, 1.0));
      start = ends[k];
    }
    // Nothing but contacts: the null space is cheap.
    if (last <= first) log_cost = std::log(least);
    costs.t[last] = log_cost;
    costs.root = (-0.5 * costs.t).array().exp();
    if (log_cost < 0.0) costs.t /= log_cost;
  }

  // Of Q = X B, with orthonormal rows and a lower triangular X, level after level.
  template <class Rows> void write_exact_levels(const Rows& Q) {
    const Index count = std::min(jacobian.rows(), N.rows());  // more of them are never exact
    N.topRows(count) = Q.topRows(count);
    write_roots(count);
    complete(count);
  }

  // Write the directions that belong to one of the first levels alone; return their number. The
  // last of them may have singular values below the threshold: these are left out.
  Index write_levels(Index levels) {
    whiten(jacobian, L, form, B);
    B.array().colwise() /= units.array();
    Index count = 0, start = 0;
    for (Index k = 0; k < levels; ++k) {
      auto rows = B.middleRows(start, ends[k] - start);
      for (Index r = 0; r < rows.rows(); ++r)
        for (Index i = 0; i < count; ++i) rows.row(r) -= N.row(i).dot(rows.row(r)) * N.row(i);
      if (k < edge_level[0] - 1) {
        if (count + rows.rows() > N.rows()) return count;  // no law is exact with so many rows
        // No singular value is small: any orthonormal rows will do, at a tenth of the cost.
        auto own = N.middleRows(count, rows.rows());
        auto factor = square.topLeftCorner(rows.rows(), rows.rows());
        orthonormalise_rows(rows, own, factor);
        count += rows.rows();
      } else {
        auto none = square.topRows(0);
        orthogonalise_rows(rows, none);
        for (Index r = 0; r < rows.rows(); ++r) {
          const double value = rows.row(r).norm();
          if (value >= thresholds[k] && count < N.rows()) N.row(count++) = rows.row(r) / value;
        }
      }
      start = ends[k];
    }
    return count;
  }

  // 1/√ρ of directions that each belong to one level.
  void write_roots(Index count) {
    Index k = 0;
    for (Index r = 0; r < count; ++r) {
      while (k < ends.size() && r >= ends[k]) ++k;
      root[r] = costs.root[k];
    }
    kept[0] = ends.size() ? std::min<Index>(count, ends[0]) : 0;
  }

  // Write the directions of the only level, if the law has found its spectrum; return their number.
  //
  // First those that belong to it alone. The null space has the share λ (1 - s²/threshold²)² of a
  // direction with the singular value s below the threshold.
  Index write_damped_level() {
    const auto& Q = factors.Q;
    const double threshold = thresholds[0], own = costs.root[0];
    // With a part of the exact law no singular value is small (`edge/shares.hpp`).
    const double least_value = slack[0] < 1.0 ? 0.0 : lost * threshold;
    Index count = 0;
    const auto add = [&](bool partly) {
      for (Index r = 0; r < Q.rows(); ++r) {
        const double s = Q.row(r).norm();
        if ((s < threshold) != partly || s <= least_value || count == N.rows()) continue;
        const double left = std::max(1.0 - (s / threshold) * (s / threshold), 0.0);
        root[count] = own * std::pow(free_root() / own, slack[0] * left * left);
        N.row(count++) = Q.row(r) / s;
      }
    };
    add(false);
    kept[0] = count;
    add(true);
    return count;
  }

  // Overwrite the directions after the first ones, which are shared by levels.
  //
  // These are the eigenvectors of T = Σ t_k (P_{k-1} - P_k) + P_K in the rows of N from `count` on,
  // and their costs ρ_N^t for the eigenvalues t. T is that of the damped law, in the proportion λ,
  // and that of the exact one.
  void share_rest(Index count) {
    const Index d = N.rows() - count;
    if (d == 0) return;
    auto rest = N.bottomRows(d);
    auto F_d = F.topRows(d), FQ_d = FQ.topRows(d);
    auto T_d = T.topLeftCorner(d, d), U_d = U.topLeftCorner(d, d);
    // Lᵀ Q L is Q in whitened coordinates.
    if (form == IDENTITY) F_d = rest;
    else F_d.noalias() = rest * L.transpose();
    FQ_d.noalias() = F_d * projectors.Q.transpose();
    T_d.noalias() = FQ_d * F_d.transpose();
    Index start = 0;
    for (Index k = 0; k < ends.size(); ++k) {
      const Index rows = ends[k] - start;
      if (costs.t[k] > 0.0 && rows > 0) {
        auto J = FJ.topLeftCorner(d, rows), G = FG.topLeftCorner(d, rows);
        J.noalias() = F_d * projectors.QJ.middleCols(start, rows);
        G.noalias() = J * projectors.G_inverse.block(start, start, rows, rows).transpose();
        T_d.noalias() += costs.t[k] * G * J.transpose();
      }
      start = ends[k];
    }
    if (slack[0] < 1.0) mix_with_exact(rest, T_d);
    T_d.diagonal().array() += 1.0;  // eigenvalues between 1 and 2: their vectors are well defined
    orthogonalise_rows(T_d, U_d);
    for (Index r = 0; r < d; ++r)
      root[count + r] = std::pow(free_root(), std::clamp(T_d.row(r).norm() - 1.0, 0.0, 1.0));
    F_d.noalias() = U_d * rest;
    rest = F_d;
  }

  // λ T + (1 - λ) T_exact; of that law each row q of Q belongs to one level, and what is left of
  // the identity to the null space.
  template <class Rest, class Square> void mix_with_exact(const Rest& rest, Square& T_d) {
    const double other = 1.0 - slack[0];
    T_d *= slack[0];
    T_d.diagonal().array() += other;
    auto q = FG.col(0).head(rest.rows());
    for (Index k = 0, r = 0; k < ends.size(); ++k)
      for (; r < ends[k]; ++r) {
        q.noalias() = rest * exact.Q.row(r).transpose();
        T_d.noalias() += other * (costs.t[k] - 1.0) * q * q.transpose();
      }
  }

  // Complete the first directions to an orthonormal basis, with the null space.
  //
  // Each new row is the residual of the unit vector with the largest residual. The components of a
  // unit vector are entries of N. Where less than half of it remains, the rounding errors are
  // subtracted ("twice is enough", Giraud et al. 2005).
  void complete(Index count) {
    remainders.setOnes();
    for (Index k = 0; k < count; ++k) remainders -= N.row(k).cwiseAbs2().transpose();
    for (Index k = count; k < N.rows(); ++k) {
      const Index best =
          std::max_element(remainders.begin(), remainders.end()) - remainders.begin();
      const auto others = N.topRows(k);
      auto row = N.row(k);
      auto share = shares.head(k);
      share = others.col(best);
      row.setZero();
      row[best] = 1.0;
      row.transpose().noalias() -= others.transpose() * share;
      if (row.squaredNorm() < 0.5) {
        share.noalias() = others * row.transpose();
        row.transpose().noalias() -= others.transpose() * share;
      }
      row /= row.norm();
      remainders -= row.cwiseAbs2().transpose();
      root[k] = free_root();
    }
  }
};

struct InverseRoot {
  static constexpr const char* doc =
      "Jᵀ of H⁻¹ = J Jᵀ, without the levels before the first that may move.";
  In<'n', 'n'> N;
  Ints<1> kept;
  In<'n'> root;
  In<'n', 'n'> L;
  std::int64_t form;
  bool standing;  // whether the first level may not move
  Out<'n', 'n'> JT;
  OutInts<1> moving;  // number of these rows

  void operator()() {
    const Index rows = N.rows() - (standing ? std::clamp<Index>(kept[0], 0, N.rows()) : 0);
    auto moves = JT.topRows(rows);
    moves = root.tail(rows).asDiagonal() * N.bottomRows(rows);
    if (form != IDENTITY) solve_rows_transposed(L, moves);
    moving[0] = rows;
  }
};

}  // namespace hsp
