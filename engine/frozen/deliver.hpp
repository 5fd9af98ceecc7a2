// The end of a step without Python: which effort is delivered, and whether there is one.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/kind.hpp>
#include <stdexcept>

#include "../law/outcome.hpp"
#include "../limits/acceleration_bounds.hpp"
#include "../limits/records.hpp"

namespace hsp {

// The decisions are those of `BoundStep.make` and `Actuation.delivered` in Python.
struct Deliver {
  static constexpr const char* doc =
      "The effort of a step: the law's own M a + N within the limits, else the nearest; the last "
      "one stays where none is finite. Whether there is one.";
  LawOutcome<Ints> law;
  LimitsOutcome<Ints> limits;
  QPOutcome<Ints> qp;
  In<'n'> acceleration, effort;  // of the law
  In<'n'> nearest_acceleration, nearest_effort;
  In<'n'> wanted, lower, upper;  // the QP's unconstrained solution, and bounds of the effort
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
    if (limits.violated[0] && !nearest) {  // the solver failed
      tau = wanted.cwiseMax(lower).cwiseMin(upper);
      status[0] = relaxed;
    }
    if (limits.beyond[0]) status[0] = beyond;
    return true;
  }
};

// With contacts that carry the robot: the decision of `Actuation._within_limits` in Python.
struct ForcesWithin {
  static constexpr const char* doc =
      "Whether the law's acceleration is delivered with the forces of minimum norm, needs others, "
      "or has to change.";
  LimitsOutcome<Ints> limits;
  In<'c', 'f'> cone;  // four rows for each point, which has three forces
  In<'f'> forces, lower, upper;
  In<'n'> tau, tau_lower, tau_upper;
  OutInts<1> exact, redistribute, nearest;

  void check() const { check_at_least("the rows of cone", cone.rows(), forces.size() / 3 * 4); }
  void operator()() {
    const bool moves = !(limits.motion[0] || limits.rows[0]);
    bool carries =
        (lower.array() <= forces.array()).all() && (forces.array() <= upper.array()).all();
    for (Index point = 0; point < forces.size() / 3; ++point) {
      const auto f = forces.segment<3>(3 * point);
      carries &= ((cone.block<4, 3>(4 * point, 3 * point) * f).array() >= 0.0).all();
    }
    exact[0] = moves && carries && is_within(tau, tau_lower, tau_upper);
    redistribute[0] = !exact[0] && moves;
    nearest[0] = !exact[0] && !moves;
  }
};

struct DeliverWithForces {
  static constexpr const char* doc =
      "The effort of a step in which contacts carry; the last one stays where none is finite. "
      "Whether there is one.";
  LawOutcome<Ints> law;
  LimitsOutcome<Ints> limits;
  QPOutcome<Ints> qp;
  Ints<1> exact, redistribute;
  In<'n'> acceleration, effort;  // of the law
  In<'f'> forces;                // of minimum norm [N]
  In<'n'> nearest_acceleration, nearest_effort;
  In<'f'> nearest_forces;
  Ints<'b'> base;  // dofs without a motor
  In<'n'> lower, upper;
  std::int64_t redistributed, relaxed, beyond;
  Out<'n'> a, tau;
  Out<'f'> f;
  OutInts<1> status, delivered;
  Scratch<'n'> found;

  void check() const { check_indices("base", base, tau.size()); }
  bool operator()() {
    const bool solved = !exact[0] && !qp.unsolved[0];
    if (exact[0]) found = effort;
    else if (solved) found = nearest_effort;
    else {  // the solver failed
      found = effort.cwiseMax(lower).cwiseMin(upper);
      for (Index i = 0; i < base.size(); ++i) found[base[i]] = 0.0;
    }
    delivered[0] = law.finite[0] && found.allFinite();
    if (!delivered[0]) return false;
    tau = found;
    if (solved) f = nearest_forces;
    else f = forces;
    const bool same = redistribute[0] && qp.status[0] == redistributed;
    if (solved && !same) a = nearest_acceleration;
    else a = acceleration;
    status[0] = exact[0] ? 0 : solved ? qp.status[0] : relaxed;
    if (limits.beyond[0]) status[0] = beyond;
    return true;
  }
};

}  // namespace hsp
