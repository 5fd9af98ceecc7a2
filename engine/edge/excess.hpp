// How far an acceleration is beyond limits, relative to what they permit far from them.
//
// The permitted value is, for an effort, its maximum; for an acceleration, that of the barriers of
// `Limits` far from them. The limit on the effort's rate is ignored: it depends on the last effort,
// and a step that waited for it would wait for ever.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/records.hpp>

namespace hsp {

// The law's command, plus the compensators' part; the effort is M a + N, without contact forces.
template <template <int...> class As> struct Wanted {
  In<'n', 'n'> mass_matrix;
  As<'n'> acceleration, effort;
};

// The largest values far from all limits; inf where there is no limit.
struct Permitted {
  In<'n'> effort, acceleration;
  double bandwidth;  // α of the barriers of positions and speeds [1/s]

  // An acceleration, which needs an effort, relative to the permitted ones.
  template <class A, class E> double ratio(const A& needed, const E& needs) const {
    const double efforts = greatest(needs.array().abs() / effort.array());
    const double motions = greatest(needed.array().abs() / acceleration.array());
    return std::max({0.0, efforts, motions});
  }
};

// The limits of a step.
template <template <int...> class As> struct StepLimits {
  In<'n'> lower, upper;  // of the acceleration
  // Rows A of `Barrier` and `StaticEffort`, of which the first n columns are used: A δ ≥ least for a
  // deviation δ from the unconstrained a.
  In<'k', 'w'> rows;
  As<'k'> least;
  Permitted permitted;

  void check() const { check_at_least("the columns of rows", rows.cols(), lower.size()); }

  auto row(Index r) const { return rows.row(r).head(lower.size()).transpose(); }

  // The excess of a + δ, 0 within all limits; `effort` is that of a + δ.
  template <class A, class D, class E>
  double excess(const A& a, const D& deviation, const E& effort) const {
    const auto efforts = effort.array().abs() / permitted.effort.array();
    const auto above = (a + deviation - upper).array();
    const auto below = (lower - a - deviation).array();
    const auto motions = above.max(below) / permitted.acceleration.array();
    double most = std::max({0.0, greatest(efforts) - 1.0, greatest(motions)});
    const double smallest = a.size() ? permitted.acceleration.minCoeff() : 0.0;
    for (Index r = 0; r < least.size(); ++r) {
      const double missing = least[r] - row(r).dot(deviation);
      if (missing > 0.0) most = std::max(most, missing / (row(r).norm() * smallest));
    }
    return most;
  }
};

}  // namespace hsp
