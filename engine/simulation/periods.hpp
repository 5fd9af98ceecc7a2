// Many control periods of a simulation as one call, as long as its controller's steps are free.
#pragma once
#include "../src/move.hpp"

namespace hsp {

struct Periods {
  static constexpr const char* doc =
      "Move a plant on from one period to another, or to one that is not free; return which.";
  Shared<Plan> moving;   // integrates the plant over the interval
  Shared<Move> law;      // (t, q, v) ↦ whether the step is free; writes the effort
  Shared<Plan> sending;  // records that this effort is held from now on
  In<'q'> q;
  In<'n'> v;
  Out<'n'> held;      // what the plant is under
  In<'n'> effort;     // what the law writes
  Out<2> interval;    // both ends of a period
  double free_below;  // a step that returns a number from 0 to this one is free
  In<5> which;        // start of period 0, length of all [s], how many, the present one, the last

  double operator()() {
    const double start = which[0], span = which[1], periods = which[2];
    const double first = which[3], last = which[4];
    double t = start + first * span / periods;
    for (double k = first + 1.0; k <= last; ++k) {
      interval[0] = t;
      interval[1] = t = start + k * span / periods;
      moving->run(t);
      if (k == last) break;
      const double code = law->to(t, q, v);
      if (!(0.0 <= code && code < free_below)) return k;
      held = effort;
      if (!std::isfinite(effort.squaredNorm())) return k;
      sending->run(t);
    }
    return last;
  }
};

}  // namespace hsp
