// The safe stop, of a live loop and of a program without Python: see `hsp_control/control/stop.py`.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/kind.hpp>
#include <hsp/linalg.hpp>

namespace hsp {

struct Brake {
  static constexpr const char* doc =
      "The force that damps a robot, -k M v, until it is at rest, and that then holds it, -M0 (w² "
      "(q "
      "- q0) + 2 w v). Where nothing carries its base, that damps the joints alone, without "
      "gravity.";
  double damping, natural_frequency, rest_speed, longest_damping;
  In<1> period;  // [s]
  In<'q'> q;
  In<'n'> v, away;  // q - q0, of the last q0
  In<'n', 'n'> M;
  Ints<'b'> base;       // dofs without a motor,
  In<'f'> standing;     // and its supports: 1 for each force of a stance foot, 0 for others
  InOut<1> damped_for;  // [s]
  InOutInts<1> holding;
  InOut<'q'> held_q;  // q0
  InOut<'n', 'n'> held_mass;
  InOut<'n'> gravity;
  Out<'n'> force;
  Scratch<'n'> rate;

  void check() const { check_indices("base", base, v.size()); }
  void operator()() {
    const bool rests = greatest(v.cwiseAbs()) <= rest_speed;
    const bool begins = !holding[0] && (rests || damped_for[0] >= longest_damping);
    if (begins) {
      holding[0] = true;
      held_q = q;
      held_mass = M;
    }
    if (!holding[0]) damped_for[0] += period[0];
    if (base.size() > 0 && !(standing.array() != 0.0).any()) {
      sink();
    } else if (holding[0]) {
      rate = 2.0 * natural_frequency * v;
      if (!begins) rate += natural_frequency * natural_frequency * away;
      force.noalias() = held_mass.lazyProduct(rate);
      force = -force;
    } else {
      force.noalias() = M.lazyProduct(v);
      force *= -damping;
    }
  }

 private:
  void sink() {
    rate = v;
    for (Index i = 0; i < base.size(); ++i) rate[base[i]] = 0.0;
    force.noalias() = M.lazyProduct(rate);
    force *= -damping;
    for (Index i = 0; i < base.size(); ++i) force[base[i]] = 0.0;
    gravity.setZero();
  }
};

struct ScaleIntoLimits {
  static constexpr const char* doc =
      "tau = base + s direction with the largest s in [0, 1] within ± limits; 0 if there is none.";
  In<'n'> base, direction, limits;
  Out<'n'> tau;

  // Damping that is clipped joint by joint could add energy.
  double operator()() {
    double share = 1.0;
    for (Index i = 0; i < base.size(); ++i) {
      const double size = std::abs(direction[i]);
      const double sign = (direction[i] > 0.0) - (direction[i] < 0.0);
      const double room = std::max(limits[i] - sign * base[i], 0.0);
      if (size > room) share = std::min(share, room / size);
    }
    tau = base + share * direction;
    return share;
  }
};

}  // namespace hsp
