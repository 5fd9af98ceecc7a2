// A barrier that begins smoothly at a distance and is finite everywhere.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/kind.hpp>

namespace hsp {

struct BarrierValue {
  double value, slope, curvature;
};

// b(s) = -(1 - s)² ln s, b' and b'', with s the distance relative to that at which the barrier
// begins.
//
// C², zero for s ≥ 1. Below the core its second-order Taylor polynomial at the core replaces it,
// so that it is finite for all s (Li et al. 2020, incremental potential contact).
inline BarrierValue barrier_at(double s) {
  constexpr double core = 0.02;
  if (s >= 1.0) return {0.0, 0.0, 0.0};
  const double at = std::max(s, core), away = 1.0 - at, log = std::log(at);
  const double value = -away * away * log;
  const double slope = 2.0 * away * log - away * away / at;
  const double curvature = -2.0 * log + 4.0 * away / at + away * away / (at * at);
  const double below = std::min(s - core, 0.0);
  return {value + (slope + 0.5 * curvature * below) * below, slope + curvature * below, curvature};
}

struct Barrier {
  static constexpr const char* doc =
      "f = Σ b(d_k/influence), and its slopes and curvatures by d_k [1/m, 1/m²].";
  In<'d'> distances;  // [m]
  double influence;   // [m]
  Out<'d'> slopes, curvatures;

  double operator()() {
    double total = 0.0;
    for (Index k = 0; k < distances.size(); ++k) {
      const auto [value, slope, curvature] = barrier_at(distances[k] / influence);
      total += value;
      slopes[k] = slope / influence;
      curvatures[k] = curvature / (influence * influence);
    }
    return total;
  }
};

}  // namespace hsp
