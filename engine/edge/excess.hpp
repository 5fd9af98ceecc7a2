// How far an acceleration is beyond limits, relative to what they permit far from them.
//
// The permitted value is, for an effort, its maximum; for an acceleration, that of the barriers of
// `Limits` far from them. The limit on the effort's rate is ignored: it depends on the last effort,
// and a step that waited for it would wait for ever.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/records.hpp>

namespace hsp {

// Of the acceleration.
struct BoundsOfMotion {
  In<'n'> lower, upper;
};

// Far from the limits; inf where there is none.
struct Permitted {
  In<'n'> effort, acceleration;
  double bandwidth;  // α of the barriers [1/s]
};

// Rows of barriers for a deviation δ from the unconstrained a: A δ ≥ lower. The first n columns of
// A are used.
template <template <int...> class As> struct Barred {
  In<'k', 'w'> A;
  As<'k'> lower;
};

// The excess of a + δ, 0 within all limits; `effort` is that of a + δ.
template <class B, class A, class D, class E>
double excess(const BoundsOfMotion& bounds, const Permitted& permitted, const B& barred, const A& a,
              const D& deviation, const E& effort) {
  const auto efforts = effort.array().abs() / permitted.effort.array();
  const auto above = (a + deviation - bounds.upper).array();
  const auto below = (bounds.lower - a - deviation).array();
  const auto motions = above.max(below) / permitted.acceleration.array();
  double most = std::max({0.0, greatest(efforts) - 1.0, greatest(motions)});
  const double least = a.size() ? permitted.acceleration.minCoeff() : 0.0;
  for (Index r = 0; r < barred.lower.size(); ++r) {
    const auto row = barred.A.row(r).head(a.size());
    const double missing = barred.lower[r] - row.dot(deviation.transpose());
    if (missing > 0.0) most = std::max(most, missing / (row.norm() * least));
  }
  return most;
}

// An acceleration, which needs an effort, relative to the permitted ones.
template <class A, class E>
double relative(const Permitted& permitted, const A& acceleration, const E& effort) {
  const double efforts = greatest(effort.array().abs() / permitted.effort.array());
  const double motions = greatest(acceleration.array().abs() / permitted.acceleration.array());
  return std::max({0.0, efforts, motions});
}

}  // namespace hsp
