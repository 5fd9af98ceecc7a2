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
      "The weighted mean of the efforts of parts, which not even by rounding leaves their range, "
      "with the worst status: whether each that has a share has kept something.";
  In<'s'> shares;      // of each set of tasks
  In<'l'> limits;      // of each set of limits
  In<'k', 'm'> parts;  // of each set of tasks within each set of limits
  Ints<'k'> kept, statuses;
  std::int64_t limited;  // the status of a part that is the nearest within limits
  Out<'m'> mean;
  OutInts<1> worst;

  void check() const {
    if (parts.rows() != shares.size() * limits.size())
      throw std::invalid_argument("parts needs a row for each set of tasks and of limits");
  }
  bool operator()() {
    worst[0] = 0;
    bool any = false;
    for (Index k = 0; k < parts.rows(); ++k) {
      if (share(k) == 0.0) continue;
      if (kept[k] == KeepPart::NEITHER) return false;
      any = true;
      const std::int64_t own = kept[k] == KeepPart::NEAREST ? limited : statuses[k];
      worst[0] = std::max(worst[0], own);
    }
    if (!any) return false;
    for (Index i = 0; i < mean.size(); ++i) mean[i] = mixed(i);
    return true;
  }

 private:
  double share(Index k) const { return shares[k / limits.size()] * limits[k % limits.size()]; }

  double mixed(Index i) const {
    double sum = 0.0, least = 0.0, most = 0.0;
    bool first = true;
    for (Index k = 0; k < parts.rows(); ++k) {
      if (share(k) == 0.0) continue;
      const double x = parts(k, i), own = share(k) * x;
      sum = first ? own : sum + own;
      least = first ? x : std::min(least, x);
      most = first ? x : std::max(most, x);
      first = false;
    }
    return std::clamp(sum, least, most);
  }
};

struct FadingContact {
  static constexpr const char* doc =
      "How much a contact that comes or goes is kept at rest, 1 - (1 - x)³ with x its weight over "
      "that from which it is kept: C² in time, as the weight.";
  In<1> weight;
  double held;
  Out<1> share;

  void operator()() {
    const double x = std::min(weight[0] / held, 1.0);
    share[0] = x * (3.0 - x * (3.0 - x));
  }
};

struct FadingForces {
  static constexpr const char* doc =
      "Bounds on the normal forces of a contact that comes or goes, and how dear its forces are.";
  In<1> weight;        // of the contact
  In<'p'> full;        // e where it is fully active: the cost is Σ f²/e
  double most, robot;  // largest normal force in weights of the robot, and this [N]
  Out<'p'> upper, inverse_cost;
  Out<1> command;  // weight of its commanded force

  void operator()() {
    const double on = std::max(weight[0], 1e-6);
    for (Index i = 2; i < upper.size(); i += 3) upper[i] = on * most * robot;
    for (Index i = 0; i < full.size(); ++i) inverse_cost[i] = on * full[i];
    command[0] = weight[0];
  }
};

struct HasShare {
  static constexpr const char* doc = "Which of several have a share.";
  In<'n'> shares;
  OutInts<'n'> on;

  void operator()() {
    for (Index k = 0; k < on.size(); ++k) on[k] = shares[k] > 0.0;
  }
};

}  // namespace hsp
