// A streamed reference without Python: a message is a target, or a velocity in world axes, and only
// the newest is used.
#pragma once
#include <limits>

#include "pieces.hpp"

namespace hsp {

// What `RunningStream` does with the policy "latest", to the last bit.
struct StreamAlone {
  static constexpr const char* doc =
      "A reference that goes to the newest target or velocity, whatever is sent and when.";
  double linear;
  double delay, dead_man, hold_after;  // [s]
  MotionBounds<In> bounds;
  InOut<'p'> piece;
  InOut<'w'> target;                                  // what is followed
  InOut<'n'> velocity;                                // linear, then angular, in world axes
  InOutInts<1> follows;                               // `Follows`
  InOut<1> now, begun, heard, fades_at, target_time;  // [s]
  InOutInts<1> silent;
  InOut<'w'> sent_target;  // what comes to count in the next step
  InOut<'n'> sent_velocity;
  InOutInts<1> sent;     // `Follows`
  InOutInts<1> differs;  // whether it differs from what is followed
  ChartState<Out> out;
  PlannerMemory memory;

  enum Follows { NOTHING, TARGET, VELOCITY };
  static constexpr double infinite = std::numeric_limits<double>::infinity();
  static constexpr double largest = 1e6;  // of a number that is sent: see `message.py`
  static constexpr double unit = 1e-3;    // deviation of a quaternion's norm from 1

  void check() const {
    check_piece(piece.size(), out.x.size());
    check_linear(linear, out.x.size());
    check_at_least("target", target.size(),
                   linear == out.x.size() ? out.x.size() : out.x.size() + 1);
  }

  void operator()(double t) {
    const Index n = out.x.size();
    memory.set(linear, bounds);
    Piece present(piece.data(), n);
    if (now[0] == -infinite) now[0] = begun[0] = t;  // what is sent comes to count later
    else if (t > now[0]) advance(t, present);
    present.state(t, memory.state);
    memory.state.copy_to(out);
  }

  // Take a target: whether it is one.
  template <class Values> bool send_target(const Values& given) {
    if (!(given.cwiseAbs().array() <= largest).all()) return false;
    sent_target = given;
    if (linear != out.x.size()) {
      double sum = 0.0;  // in this order, as NumPy's
      const Index n = static_cast<Index>(linear);
      for (Index i = 0; i < 4; ++i) sum += sent_target[n + i] * sent_target[n + i];
      const double norm = std::sqrt(sum), off = std::abs(norm - 1.0);
      if (off > unit) return false;
      if (off > 1e-15)
        for (Index i = 0; i < 4; ++i) sent_target[n + i] /= norm;
    }
    sent[0] = TARGET;
    differs[0] = true;
    return true;
  }

  // Take a velocity: whether it is one.
  template <class Values> bool send_velocity(const Values& given) {
    if (!(given.cwiseAbs().array() <= largest).all()) return false;
    const std::int64_t last = sent[0] == NOTHING ? follows[0] : sent[0];
    const bool same =
        last == VELOCITY && (sent[0] == NOTHING ? velocity == given : sent_velocity == given);
    differs[0] = differs[0] || !same;
    sent_velocity = given;
    sent[0] = VELOCITY;
    return true;
  }

 private:
  void advance(double t, Piece& present) {
    now[0] = t;
    double due;
    while ((due = std::min(present.end(), fades_at[0])) <= t) {
      if (due == fades_at[0] && follows[0] == VELOCITY) {
        velocity.setZero();
        fades_at[0] = infinite;
      }
      plan(due, present);
    }
    const bool changed = take(t);
    const bool was = silent[0] != 0;
    silent[0] = t - std::max(heard[0], begun[0]) > hold_after;
    if (changed || (silent[0] && !was)) plan(t, present);
  }

  // Whether what was sent changes what lies ahead.
  bool take(double t) {
    if (sent[0] == NOTHING) return false;
    heard[0] = t;
    const bool changed = differs[0] || silent[0];
    follows[0] = sent[0];
    fades_at[0] = infinite;
    if (sent[0] == TARGET) {
      target = sent_target;
      target_time[0] = t + delay;
    } else {
      velocity = sent_velocity;
      fades_at[0] = t + dead_man;
    }
    sent[0] = NOTHING;
    differs[0] = false;
    return changed;
  }

  void plan(double t, Piece& present) {
    OwnState& state = memory.state;
    Planner& planner = memory.planner;
    present.state(t, state);
    rebase(state, static_cast<Index>(linear));
    bool found = false;
    if (silent[0] || follows[0] == NOTHING) found = planner.to_rest(t, state, delay, present);
    else if (follows[0] == VELOCITY) {
      memory.velocity = velocity;
      found = planner.follow(t, state, memory.velocity, false, delay, present) != Planned::NONE;
    } else {
      found = planner.to_target(t, state, target.data(), target_time[0], delay, present);
    }
    if (found) return;
    follows[0] = NOTHING;  // so far away that no motion is found
    fades_at[0] = infinite;
    // Where it cannot even rest, what follows is not finite, and the step is refused.
    if (planner.to_rest(t, state, delay, present)) return;
    present.begin(PieceForm::COAST, t, infinite, state.base);
    present.body().setConstant(std::numeric_limits<double>::quiet_NaN());
  }
};

}  // namespace hsp
