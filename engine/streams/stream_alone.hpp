// A streamed reference without Python: a message is a target, or a velocity in world axes.
#pragma once
#include <algorithm>
#include <limits>

#include "pieces.hpp"

namespace hsp {

// Equal to `StreamRun`, to the last bit, for one target and one velocity each period.
struct StreamAlone {
  static constexpr const char* doc =
      "A reference that follows targets and velocities, sent at any time. A target may have a "
      "velocity, and a time by the sender's clock.";
  double linear;
  double policy;                                                 // `Policy`
  double delay, smoothing, extrapolation, dead_man, hold_after;  // [s]
  MotionBounds<In> bounds;
  InOut<'p'> piece;
  InOut<'k'> times;  // of waypoints, in order [s]
  InOut<'k', 'w'> values;
  InOut<'k', 'n'> rates;                              // their velocities, if given
  View<bool, Access::InOut, Order::Rows, 'k'> given;  // whether they are
  InOutInts<1> count;                                 // number of waypoints
  InOut<'n'> velocity;                   // the command: linear, then angular, in world axes
  InOutInts<1> commanded;                // whether it is followed, instead of waypoints
  InOut<1> now, begun, heard, fades_at;  // [s]
  InOutInts<1> silent;
  InOut<'w'> sent_target;  // message that is used in the next step
  InOut<'n'> sent_velocity;
  InOutInts<1> sent;      // `Sent`, the last one
  InOutInts<1> differs;   // whether a velocity differs from the one sent before it
  InOutInts<1> alone;     // whether a velocity was sent, which ends all waypoints
  InOutInts<1> targeted;  // whether a target was
  // Data of the next target, and of the one that was sent.
  InOut<'n'> next_rate, sent_rate;
  InOut<1> next_time, sent_time;  // by the sender's clock [s]
  InOutInts<1> next_moves, sent_moves, next_timed, sent_timed;
  // `Waypoints` and `SenderClock` in Python: the newest message, the time before which others are
  // ignored, the newest time of the sender's clock; when messages came, and how far that clock was
  // behind then, in a ring of increasing numbers.
  InOut<1> made, superseded, newest;
  InOut<'s'> seen_at, seen_behind;
  InOutInts<1> seen_first, seen_count;
  ChartState<Out> out;
  PlannerMemory memory;
  PassingMemory<'k'> passing;

  enum Policy { LATEST, INTERPOLATE, EXTRAPOLATE };
  enum Sent { NOTHING, TARGET, VELOCITY };
  static constexpr double infinite = std::numeric_limits<double>::infinity();
  static constexpr double largest = 1e6;      // of a number that is sent: see `message.py`
  static constexpr double unit = 1e-3;        // deviation of a quaternion's norm from 1
  static constexpr double kept = 1.0;         // how long waypoints that were passed are [s]
  static constexpr double window = 2.0;       // over which clocks are compared [s]
  static constexpr double new_clock = 1.0;    // jump back of a clock that has restarted [s]
  static constexpr double latest = 1e12;      // time of a clock [s]
  static constexpr Index most_besides = 100;  // pieces of a step that lead to no waypoint
  static constexpr Index considered = 256;    // waypoints before and after a time: see `planner.py`

  void check() const {
    check_piece(piece.size(), out.x.size());
    check_linear(linear, out.x.size());
    check_values(values.cols(), linear, out.x.size());
    check_at_least("times", times.size(), 1);
    check_at_least("seen_at", seen_at.size(), 1);
  }

  void operator()(double t) {
    const Index n = out.x.size();
    memory.set(linear, bounds);
    Piece present(piece.data(), n);
    if (now[0] == -infinite) now[0] = begun[0] = t;  // messages are used later
    else if (t > now[0]) advance(t, present);
    present.state(t, memory.state);
    memory.state.copy_to(out);
  }

  // Store a target; return whether it is valid.
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
    sent_rate = next_rate;
    sent_time = next_time;
    sent_moves = next_moves;
    sent_timed = next_timed;
    next_moves[0] = next_timed[0] = false;
    sent[0] = TARGET;
    targeted[0] = true;
    return true;
  }

  // Store the velocity of the next target; return whether it is valid.
  template <class Values> bool send_rate(const Values& wanted) {
    if (!(wanted.cwiseAbs().array() <= largest).all()) return false;
    next_rate = wanted;
    next_moves[0] = true;
    return true;
  }

  // Store the time of the next target; return whether it is valid.
  bool send_time(double wanted) {
    if (!(std::abs(wanted) <= latest)) return false;
    next_time[0] = wanted;
    next_timed[0] = true;
    return true;
  }

  // Store a velocity; return whether it is valid.
  template <class Values> bool send_velocity(const Values& given) {
    if (!(given.cwiseAbs().array() <= largest).all()) return false;
    differs[0] = differs[0] || (sent[0] == VELOCITY && sent_velocity != given);
    sent_velocity = given;
    sent[0] = VELOCITY;
    alone[0] = true;
    return true;
  }

 private:
  Index used() const { return std::clamp<Index>(count[0], 0, times.size()); }
  // The first waypoint that is not before a time, and the first after it.
  Index from(double t) const {
    return std::lower_bound(times.data(), times.data() + used(), t) - times.data();
  }
  Index after(double t) const {
    return std::upper_bound(times.data(), times.data() + used(), t) - times.data();
  }
  // The first one that matters at a time.
  Index near(double t) const {
    const Index ahead = after(t);
    const Index first = std::min(from(t - smoothing), std::max<Index>(ahead - 3, 0));
    return std::max(first, ahead - considered);
  }

  void advance(double t, Piece& present) {
    now[0] = t;
    // Each piece but the last two leads to a waypoint, or fades. So there are no more of them; but
    // for times so large that a millisecond is rounded away.
    double due;
    for (Index pieces = 0; (due = std::min(present.end(), fades_at[0])) <= t; ++pieces) {
      if (pieces > times.size() + most_besides) return lose(t, present);
      if (due == fades_at[0] && commanded[0]) {
        velocity.setZero();
        fades_at[0] = infinite;
      }
      plan(due, present);
    }
    const bool changed = take(t);
    const bool was = silent[0] != 0;
    silent[0] = t - std::max(heard[0], begun[0]) > hold_after;
    if (changed || (silent[0] && !was)) plan(t, present);
    // The last one stays the goal.
    const Index old = std::min(from(t - kept), std::max<Index>(used() - 1, 0));
    forget(std::max(old, near(t)));
  }

  // Whether the messages change the future reference.
  bool take(double t) {
    if (sent[0] == NOTHING) return false;
    heard[0] = t;
    const bool last = sent[0] == TARGET;
    bool changed = false;
    if (last && alone[0]) changed |= take_velocity(t);
    if (targeted[0]) changed |= take_target(t);
    if (!last) changed |= take_velocity(t);
    sent[0] = NOTHING;
    differs[0] = alone[0] = targeted[0] = false;
    return changed;
  }

  bool take_velocity(double t) {
    if (t < made[0]) return false;
    made[0] = superseded[0] = t;
    count[0] = 0;
    const bool same = commanded[0] && !differs[0] && velocity == sent_velocity;
    commanded[0] = true;
    velocity = sent_velocity;
    fades_at[0] = t + dead_man;
    return !same || silent[0];
  }

  bool take_target(double t) {
    double at = t;
    if (sent_timed[0]) {
      if (sent_time[0] < newest[0] - new_clock) {
        count[0] = 0;
        made[0] = superseded[0] = -infinite;
      }
      at = by_own_clock(sent_time[0], t);
    }
    const bool replaces = policy == LATEST;
    if (at < (replaces ? made[0] : superseded[0])) return false;
    const double due = at + delay;
    if (!replaces && due <= t && used() > 0 && times[used() - 1] > t) return false;
    made[0] = std::max(at, made[0]);
    if (replaces) {
      superseded[0] = at;
      count[0] = 0;
    }
    add(due);
    commanded[0] = false;
    fades_at[0] = infinite;
    return true;
  }

  // A time of the sender's clock; its message has arrived now. The fastest of the last messages
  // shows the difference of the clocks best.
  double by_own_clock(double time, double t) {
    const Index size = seen_at.size();
    Index first = std::clamp<Index>(seen_first[0], 0, size - 1),
          seen = std::clamp<Index>(seen_count[0], 0, size);
    if (time < newest[0] - new_clock) {
      seen = 0;
      newest[0] = time;
    }
    newest[0] = std::max(newest[0], time);
    while (seen > 0 && seen_at[first] < t - window) {
      first = (first + 1) % size;
      --seen;
    }
    while (seen > 0 && seen_behind[(first + seen - 1) % size] >= t - time) --seen;
    if (seen == size) {
      first = (first + 1) % size;
      --seen;
    }
    const Index last = (first + seen) % size;
    seen_at[last] = t;
    seen_behind[last] = t - time;
    seen_first[0] = first;
    seen_count[0] = seen + 1;
    return time + seen_behind[first];
  }

  void add(double time) {
    Index k = from(time);
    if (k == used() || times[k] != time) {
      if (used() == times.size()) {
        forget(1);
        k = std::max<Index>(k - 1, 0);
      }
      for (Index i = used(); i > k; --i) copy(i - 1, i);
      ++count[0];
    }
    times[k] = time;
    values.row(k) = sent_target.transpose();
    rates.row(k) = sent_rate.transpose();
    given[k] = sent_moves[0] != 0;
  }

  void copy(Index k, Index to) {
    times[to] = times[k];
    values.row(to) = values.row(k);
    rates.row(to) = rates.row(k);
    given[to] = given[k];
  }

  void forget(Index gone) {
    if (gone == 0) return;
    for (Index k = gone; k < used(); ++k) copy(k, k - gone);
    count[0] = used() - gone;
  }

  void plan(double t, Piece& present) {
    OwnState& state = memory.state;
    Planner& planner = memory.planner;
    present.state(t, state);
    rebase(state, static_cast<Index>(linear));
    if (next(t, planner, state, present)) return;
    count[0] = commanded[0] = 0;  // too far away for a motion
    fades_at[0] = infinite;
    // Where it cannot even rest, the result is not finite, and the step is refused.
    if (!planner.to_rest(t, state, delay, present)) lose(t, present);
  }

  // There is no motion: no reference is finite from now on.
  void lose(double t, Piece& present) {
    fades_at[0] = infinite;
    present.begin(PieceForm::COAST, t, infinite, memory.state.base);
    present.body().setConstant(std::numeric_limits<double>::quiet_NaN());
  }

  bool next(double t, Planner& planner, const OwnState& state, Piece& present) {
    if (commanded[0] && !silent[0]) {
      memory.velocity = velocity;
      return planner.follow(t, state, memory.velocity, false, delay, present) != Planned::NONE;
    }
    if (silent[0] || used() == 0) return planner.to_rest(t, state, delay, present);
    const Index first = near(t), end = std::min(after(t) + considered, used());
    const Waypoints way{{times.data() + first, end - first},
                        {values.row(first).data(), end - first, values.cols()},
                        {rates.row(first).data(), end - first, rates.cols()},
                        given.data() + first,
                        end < used(),
                        policy != EXTRAPOLATE && !given[used() - 1]};
    return passing.plan(planner, t, state, way, {delay, smoothing, extrapolation}, present);
  }
};

}  // namespace hsp
