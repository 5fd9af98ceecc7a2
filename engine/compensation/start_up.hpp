// A smooth transition from holding still to the law.
#pragma once
#include "../robot/joint_displacements.hpp"
#include "../trajectories/smooth_step.hpp"

namespace hsp {

struct StartUp {
  static constexpr const char* doc =
      "a ← (1 - s) (ω² (q_0 ⊖ q) - 2 ω v) + s a: s goes from 0 to 1 from the first call on.";
  In<1> time;
  In<'q'> q;
  In<'n'> v;
  Ints<'m', 3> joints;  // index in v, index in q, entries in q: all of the robot
  double duration, natural_frequency;
  InOut<1> begin;    // time of the first call [s]
  InOut<'q'> first;  // q_0
  InOutInts<1> begun;
  OutInts<1> starting;  // whether s < 1
  InOut<'n'> a;
  Scratch<'n'> away;

  void check() const { check_joint_rows(joints, q.size(), v.size()); }
  void operator()() {
    if (!begun[0]) {
      begin = time;
      first = q;
      begun[0] = 1;
    }
    const double s = smooth_step(time[0], begin[0], duration).s, w = natural_frequency;
    starting[0] = s < 1.0;
    if (!starting[0]) return;
    joint_displacements(first, q, joints, away);
    a = (1.0 - s) * (w * w * away - 2.0 * w * v) + s * a;
  }
};

}  // namespace hsp
