// The safe stop of a program without Python: see `hsp_control/live/safe_stop.py`.
#pragma once
#include <hsp/kind.hpp>
#include <hsp/linalg.hpp>

namespace hsp {

struct SafeStop {
  static constexpr const char* doc =
      "Damp, tau = g(q) - s k M v, until the robot is at rest, and then hold it, tau = g(q) - s M0 "
      "(w² (q - q0) + 2 w v); s, in [0, 1], scales the whole vector into the effort's limits.";
  double damping, natural_frequency, rest_speed, longest_damping;
  In<1> period;  // [s]
  In<'q'> q;
  In<'n'> v, gravity, away;  // q - q0, of the last q0
  In<'n', 'n'> M;
  In<'n'> limits;
  InOut<1> damped_for;  // [s]
  InOutInts<1> holding;
  InOut<'q'> held_q;  // q0
  InOut<'n', 'n'> held_mass;
  Out<'n'> tau;
  Scratch<'n'> braking, rate;

  void operator()() {
    const bool rests = v.cwiseAbs().maxCoeff() <= rest_speed;
    const bool begins = !holding[0] && (rests || damped_for[0] >= longest_damping);
    if (begins) {
      holding[0] = true;
      held_q = q;
      held_mass = M;
    }
    if (holding[0]) {
      rate = 2.0 * natural_frequency * v;
      if (!begins) rate += natural_frequency * natural_frequency * away;
      braking.noalias() = held_mass.lazyProduct(rate);
      braking = -braking;
    } else {
      damped_for[0] += period[0];
      braking.noalias() = M.lazyProduct(v);
      braking *= -damping;
    }
    // Damping that is clipped joint by joint could add energy.
    double share = 1.0;
    for (Index i = 0; i < v.size(); ++i) {
      const double size = std::abs(braking[i]);
      const double sign = (braking[i] > 0.0) - (braking[i] < 0.0);
      const double room = std::max(limits[i] - sign * gravity[i], 0.0);
      if (size > room) share = std::min(share, room / size);
    }
    tau = gravity + share * braking;
  }
};

}  // namespace hsp
