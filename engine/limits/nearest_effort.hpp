// The effort within bounds whose acceleration is nearest to that of another.
#pragma once
#include <hsp/kind.hpp>

namespace hsp {

struct NearestEffort {
  static constexpr const char* doc =
      "Minimise (x - wanted)ᵀ M⁻¹ (x - wanted) within bounds: joint by joint, in sweeps.";
  In<'n', 'n'> inverse;  // M⁻¹
  In<'n'> wanted, least, most;
  Out<'n'> nearest;
  int sweeps;    // maximum number
  double small;  // negligible change of a sweep, relative to the first one
  Scratch<'n'> away;

  void operator()() {
    double first = 0.0;
    nearest = wanted.cwiseMax(least).cwiseMin(most);
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      double largest = 0.0;
      for (Index i = 0; i < wanted.size(); ++i) {
        away = nearest - wanted;
        const double wrong = inverse.row(i).dot(away.transpose());
        const double value = std::clamp(nearest[i] - wrong / inverse(i, i), least[i], most[i]);
        largest = std::max(largest, std::abs(value - nearest[i]));
        nearest[i] = value;
      }
      if (sweep == 0) first = largest;
      if (largest <= small * first) return;
    }
  }
};

}  // namespace hsp
