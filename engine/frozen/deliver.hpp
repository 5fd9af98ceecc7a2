// The end of a step that nobody looks at: which effort is delivered, and whether there is one.
#pragma once
#include <hsp/kind.hpp>
#include <stdexcept>

#include "../law/outcome.hpp"
#include "../limits/records.hpp"

namespace hsp {

// What is decided here is what `BoundStep.make` and `Actuation.delivered` decide in Python.
struct Deliver {
  static constexpr const char* doc =
      "The effort of a step: the law's own M a + N within the limits, else the nearest; the last "
      "one stays where none is finite. Whether there is one.";
  LawOutcome<Ints> law;
  LimitsOutcome<Ints> limits;
  QPOutcome<Ints> qp;
  In<'n'> acceleration, effort;  // the law's own
  In<'n'> nearest_acceleration, nearest_effort;
  In<'n'> wanted, lower, upper;  // what the QP was asked for, and bounds of the effort
  std::int64_t relaxed, beyond;
  Out<'n'> a, tau;
  OutInts<1> status, delivered;

  bool operator()() {
    const bool nearest = limits.violated[0] && !qp.unsolved[0];
    const bool finite =
        law.finite[0] && (nearest ? nearest_effort.allFinite() : effort.allFinite());
    delivered[0] = finite;
    if (!finite) return false;
    a = nearest ? nearest_acceleration : acceleration;
    tau = nearest ? nearest_effort : effort;
    status[0] = nearest ? qp.status[0] : 0;
    if (limits.violated[0] && !nearest) {  // the solver gave up
      tau = wanted.cwiseMax(lower).cwiseMin(upper);
      status[0] = relaxed;
    }
    if (limits.beyond[0]) status[0] = beyond;
    return true;
  }
};

}  // namespace hsp
