// A step in which several sets of tasks, or of limits, are mixed: the results of all.
#pragma once
#include <algorithm>

#include "../law/outcome.hpp"
#include "sent_effort.hpp"

namespace hsp {

struct KeepPart {
  static constexpr const char* doc =
      "Keep the acceleration and the effort that one part of a mixture delivers: the law's own, or "
      "those of the nearest step within the limits; and which, or that neither is.";
  LawOutcome<Ints> law;
  LimitsOutcome<Ints> limits;
  Ints<1> nearest;  // see `IsPlain`
  In<'n'> own_acceleration, own_effort, nearest_acceleration, nearest_effort;
  Out<'n'> acceleration, effort;
  OutInts<1> kept;

  enum Kept { NEITHER, OWN, NEAREST };

  void operator()() {
    const bool own = law.finite[0] && !limits.beyond[0] && !limits.violated[0];
    kept[0] = nearest[0] ? NEAREST : own ? OWN : NEITHER;
    if (kept[0] == OWN) {
      acceleration = own_acceleration;
      effort = own_effort;
    } else if (kept[0] == NEAREST) {
      acceleration = nearest_acceleration;
      effort = nearest_effort;
    }
  }
};

struct MixParts {
  static constexpr const char* doc =
      "The weighted mean of what parts deliver, which not even by rounding leaves their range: "
      "whether each has kept something.";
  In<'k'> shares;
  In<'k', 'm'> parts;
  Ints<'k'> kept;
  Out<'m'> mean;

  void check() const { check_at_least("parts", parts.rows(), 1); }
  bool operator()() {
    if ((kept.array() == 0).any()) return false;
    for (Index i = 0; i < mean.size(); ++i) {
      const double x = parts.col(i).dot(shares);
      mean[i] = std::clamp(x, parts.col(i).minCoeff(), parts.col(i).maxCoeff());
    }
    return true;
  }
};

}  // namespace hsp
