// How far active limits may change the tasks: the share of the damped law, and the slack of the
// priorities.
//
// An arm at its workspace boundary, or moving fast towards it, commands more than its motors
// supply, with alternating signs: the nearest step within the limits would oscillate. So the damped
// law takes over in proportion to the excess E_t of the tasks' part a_t, which it does fully at E_t
// = `large`; and priorities yield (`held_levels.hpp`, `qp/deviation_cost.hpp`).
//
// But a_t is beyond limits also while nothing is wrong with the tasks: J̇v of a fast self-motion is
// a part of it, and at the end of a joint's range it lacks the braking of that motion. There the
// tasks would be left to the field. What tells both apart is the command of the errors alone, J# f
// of the exact law with f = Kp s(e). It persists where tasks cannot be met, and vanishes where they
// are. So with
//
//   r_f = J# f relative to what limits permit, or a spring's pull relative to its largest
//
// the share is at most r_f, and the priorities are strict but for the slack r_f, or μ. Where f is
// not known, of a task with no largest error above all others, r_f is 1.
#pragma once
#include "excess.hpp"

namespace hsp {

struct LimitShare {
  static constexpr const char* doc =
      "Write the share of the damped law where limits bind, and the slack of priorities.";
  Wanted<In> wanted;
  In<'n'> self_motion;  // φ_N
  In<'n'> at_rest;      // J# f
  In<'m'> pulls;        // of springs, relative to their largest
  In<1> mu;             // share of the damped law, without that of limits
  StepLimits<In> limits;
  double large;  // E_t from which on the damped law applies fully
  double least;  // of r_f
  Out<1> share;  // of the damped law in the rest, by limits
  Out<1> slack;  // from 0, strict priorities, to 1
  Scratch<'n'> change, effort_change;

  void operator()() {
    const auto& [M, a, effort] = wanted;
    change.setZero();
    const double all = limits.excess(a, change, effort);
    change = -self_motion;
    effort_change.noalias() = M * change;
    const double tasks = limits.excess(a, change, effort + effort_change);
    effort_change.noalias() = M * at_rest;
    const double of_errors = limits.permitted.ratio(at_rest, effort_change);
    const double r_f = std::max({least, of_errors, pulls.norm()});
    share[0] = std::min({tasks / large, all / large, r_f, 1.0});
    slack[0] = mu[0] + (1.0 - mu[0]) * std::min(r_f, 1.0);
  }
};

}  // namespace hsp
