// The parts of the thresholds as separate calls, for tests.
#pragma once
#include "threshold.hpp"

namespace hsp {

struct WriteThresholds {
  static constexpr const char* doc =
      "Write the units of the rows and the threshold of each level; return a singular value of the "
      "stack from which on none is bounded.";
  In<'m', 'n'> J;
  InOut<'m', 'n'> B;  // J L⁻ᵀ, overwritten by D⁻¹ J L⁻ᵀ
  Demand rows;
  double least, turning;
  Following following;
  Thresholds thresholds;

  double operator()() {
    write_units(J, B, rows, following, thresholds);
    return write_thresholds(rows, least, turning, following, thresholds);
  }
};

struct ThresholdBelow {
  static constexpr const char* doc = "The least ε of a level below others.";
  In<'d'> demand;  // its own
  double held, above;
  int level;
  Following following;
  Thresholds thresholds;

  void check() const { check_index("level", level, thresholds.own.size()); }
  double operator()() { return threshold_below(demand, held, above, level, following, thresholds); }
};

struct HowHeld {
  static constexpr const char* doc =
      "How far a level is unmet at the workspace boundary, from 0 to nearly 1.";
  double lacking, wanted, least;
  Following following;

  double operator()() { return how_held(lacking, wanted, least, following); }
};

}  // namespace hsp
