// The cost of deviations while active limits keep the tasks from being met, level by level.
//
// Where a limit is active, the step deviates from the unconstrained a by δ, and lower priorities
// deviate before a level does (`qp/deviation_cost.hpp`). Let c δ ≥ x be the limit, in whitened
// coordinates with |c| = 1, n the length of the part of c in the null space of the level, and ρ the
// cost of deviations there. In that null space δ has the length
//
//   x n/(n² + ρ (1 - n²)),
//
// whose slope in n is at most x/(n² + ρ): n depends on the posture, and so does δ. For a task that
// cannot be met x persists. So ρ has to follow x as ε follows f (`threshold.hpp`), unless lower
// priorities can supply x easily:
//
//   ρ = max_c (A/K - n²),      A = x max_j ‖L⁻¹e_j‖
//
// with A the largest joint acceleration due to x. What persists of x is the command of the errors
// at rest, J# f. The rest is due to a motion, as far as a barrier demands that of a speed, 2 α c v,
// and does not count without slack: a limit that brakes a self-motion costs a task that is met
// nothing. Of a direction of the singular value s below its threshold ε a level has the share
// 1 - λ (1 - s²/ε²)², with λ the slack of `limit_share.hpp`.
#pragma once
#include <hsp/linalg.hpp>
#include <hsp/records.hpp>

#include "../law/law.hpp"
#include "excess.hpp"

namespace hsp {

struct HeldLevels {
  static constexpr const char* doc =
      "Write the minimum cost below each level, relative to it, for the demand of the first "
      "levels beyond limits, which is bounded by that of a.";
  Wanted<In> wanted;
  In<'n', 'n'> L;
  int form;
  In<'n'> v;
  In<'n'> law;             // the law's part of a
  In<'l', 'n'> by_levels;  // the part of the law due to the first k levels
  In<'l', 'n'> at_rest;    // J# f of them
  Factors<In> factors;     // Q = X J L⁻ᵀ, orthonormal rows, X lower triangular
  Ints<'l'> ends;          // where each level's rows end
  In<'l'> thresholds;      // ε of each level
  In<'m'> units;           // D, in which singular values are, see `Thresholds`
  In<1> slack;             // λ
  StepLimits<In> limits;
  double stiffest;  // K: maximum change of δ with its direction [1/s²]
  Out<'l'> held;
  Scratch<'n'> change, effort_change, row;
  Scratch<'n'> rest, effort_at_rest;
  Scratch<'m'> share;

  void check() const { check_ends("ends", ends, factors.Q.rows()); }
  void operator()() {
    const auto& [M, a, effort] = wanted;
    write_shares();
    double longest = 0.0;
    for (Index i = 0; i < a.size(); ++i) longest = std::max(longest, length_of_joint(i));
    for (Index k = 0; k < held.size(); ++k) {
      change = by_levels.row(k).transpose() - law;
      effort_change.noalias() = M * change;
      rest = at_rest.row(k).transpose();
      row = rest - a;
      effort_at_rest = effort;
      effort_at_rest.noalias() += M * row;
      held[k] = cost(ends[k], longest / stiffest);
    }
  }

 private:
  // The share of each row's direction in its level.
  void write_shares() {
    for (Index k = 0, r = 0; k < ends.size(); ++k)
      for (; r < ends[k]; ++r) {
        const double inverse = factors.X(r, r);  // of the row, orthogonal to those before
        const double s = inverse > 0.0 ? 1.0 / (inverse * units[r] * thresholds[k]) : 0.0;
        const double left = std::max(1.0 - s * s, 0.0);
        share[r] = 1.0 - slack[0] * left * left;
      }
  }

  // The largest of A/K - n² of all limits, 0 if there is none; `rows` belong to the levels.
  double cost(Index rows, double scale) {
    const auto& [M, a, effort] = wanted;
    const auto& permitted = limits.permitted;
    double most = 0.0;
    const double braked = 2.0 * permitted.bandwidth, inf = std::numeric_limits<double>::infinity();
    // The limit in `row`, with the excess at rest, and what it demands of a motion.
    const auto consider = [&](double excess, double persists, double motion) {
      const double moving = std::min(excess - std::max(persists, 0.0), motion);
      excess -= (1.0 - slack[0]) * std::max(moving, 0.0);
      const double length = row.norm();
      double owned = 0.0;
      for (Index r = 0; r < rows; ++r) {
        const double part = factors.Q.row(r).dot(row.transpose()) / length;
        owned += share[r] * part * part;
      }
      most = std::max(most, scale * excess / length - (1.0 - owned));
    };
    for (Index i = 0; i < a.size(); ++i) {
      const double x = a[i], dx = change[i];
      const double above = std::min(x, x + dx) - limits.upper[i];
      const double below = limits.lower[i] - std::max(x, x + dx);
      if (above > 0.0 || below > 0.0) {
        length_of_joint(i);
        consider(std::max(above, below), above > 0.0 ? rest[i] : -rest[i], braked * std::abs(v[i]));
      }
      const double force = effort[i], df = effort_change[i];
      const double push = std::min(force, force + df) - permitted.effort[i];
      const double pull = -permitted.effort[i] - std::max(force, force + df);
      if (push > 0.0 || pull > 0.0) {
        whiten_row(M.col(i));
        consider(std::max(push, pull), std::abs(effort_at_rest[i]) - permitted.effort[i], inf);
      }
    }
    for (Index r = 0; r < limits.least.size(); ++r) {
      const auto own = limits.row(r);
      const double missing = limits.least[r] - std::max(own.dot(change), 0.0);
      if (missing > 0.0) {
        whiten_row(own);
        consider(missing, -own.dot(rest), braked * std::abs(own.dot(v)));
      }
    }
    return most;
  }

  double length_of_joint(Index i) {
    row.setZero();
    row[i] = 1.0;
    if (form != IDENTITY) solve_lower(L, row);
    return row.norm();
  }

  // L⁻¹c
  template <class C> void whiten_row(const C& c) {
    row = c;
    if (form != IDENTITY) solve_lower(L, row);
  }
};

}  // namespace hsp
