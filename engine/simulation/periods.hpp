// Many control periods of a simulation as one call, while no limit is active in a step.
#pragma once
#include "../law/outcome.hpp"
#include "../limits/records.hpp"
#include "../src/move.hpp"

namespace hsp {

// The k-th period begins at start + k span/periods.
struct Timing {
  In<1> start, span;  // [s]
  Ints<1> periods;
  Ints<1> first, last;  // the period that begins now, and the one after the last
};

struct Periods {
  static constexpr const char* doc =
      "Advance a plant from one period to another, or to one with an active limit; return it.";
  Shared<Plan> moving;   // integrates the plant over the interval
  Shared<Move> step;     // writes the effort, and the outcome of law and limits
  Shared<Plan> sending;  // records that this effort is held from now on
  In<'q'> q;
  In<'n'> v;
  Out<'n'> held;    // effort that acts on the plant
  In<'n'> effort;   // written by the step
  Out<2> interval;  // both ends of a period
  LawOutcome<Ints> law;
  LimitsOutcome<Ints> limits;
  Timing timing;

  void check() const { step->check_moved_by(q, v); }
  std::int64_t operator()() {
    const std::int64_t last = timing.last[0];
    double t = beginning(timing.first[0]);
    for (std::int64_t k = timing.first[0] + 1; k <= last; ++k) {
      interval[0] = t;
      interval[1] = t = beginning(k);
      moving->run(t);
      if (k == last) break;
      if (!step->to(t, q, v) || !is_free()) return k;
      held = effort;
      if (!std::isfinite(effort.squaredNorm())) return k;
      sending->run(step->time[0]);
    }
    return last;
  }

 private:
  double beginning(std::int64_t k) const {
    const double passed = static_cast<double>(k) * timing.span[0];
    return timing.start[0] + passed / static_cast<double>(timing.periods[0]);
  }

  // Whether the effort is the law's; its inverse may be bounded.
  bool is_free() const { return law.finite[0] && !limits.violated[0] && !limits.beyond[0]; }
};

}  // namespace hsp
