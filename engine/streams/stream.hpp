// A streamed reference: messages become waypoints or a velocity, and these a motion, piece by
// piece.
//
// Whenever messages are taken, the rest of the reference is planned again from its present state
// (x, x', x''). A piece, once begun, never changes; so the reference is a C² function of time for
// any messages and any sampling.
#pragma once
#include <limits>

#include "known_waypoints.hpp"
#include "pieces.hpp"

namespace hsp {

// The message that a program is about to send, without Python.
struct SentMessage {
  InOut<'w'> target;
  InOut<'n'> velocity;        // alone
  InOut<'n'> rate;            // velocity of the next target,
  InOut<1> time;              // and its time by the sender's clock [s]
  InOutInts<1> moves, timed;  // whether it has them
};

struct Stream {
  static constexpr const char* doc =
      "A reference that follows messages: targets, velocities, chunks of waypoints. A step takes "
      "those of the queue, and goes on to its time; whether there is a reference.";
  double linear;  // number of coordinates before a rotation
  double policy;  // `Policy`
  double delay, smoothing, extrapolation, dead_man, hold_after, stop_after;  // [s]
  double tool;  // whether velocities alone are in the body's axes
  MotionBounds<In> bounds;
  MessageQueue queue;
  KnownWaypoints waypoints;
  InOut<'h', 'p'> pieces;                   // the last ones, in a ring
  InOutInts<1> piece;                       // number of the present one
  InOut<'n'> velocity;                      // the command: linear, then angular
  InOutInts<1> commanded;                   // whether it is followed, instead of waypoints
  InOutInts<1> in_tool;                     // whether it is in the body's axes
  InOut<1> now, begun, received, fades_at;  // [s]
  InOutInts<1> silent;                      // whether it rests for lack of messages
  InOutInts<1> lost;                        // whether no motion was found, not even to rest
  InOutInts<1> taken, late, refused;        // numbers of messages
  SentMessage sent;
  ChartState<Out> out;
  PlannerMemory memory;
  PassingMemory<'k'> passing;

  enum Policy { LATEST, INTERPOLATE, EXTRAPOLATE };
  static constexpr double infinite = std::numeric_limits<double>::infinity();
  static constexpr double nothing = std::numeric_limits<double>::quiet_NaN();
  static constexpr double largest = 1e6;         // of a number that is sent: see `message.py`
  static constexpr double latest = 1e12;         // time of a clock [s]
  static constexpr double unit = 1e-3;           // deviation of a quaternion's norm from 1
  static constexpr Index most = Index{1} << 62;  // of what is counted: no run goes on to 2^63
  static constexpr Index most_besides = 100;     // pieces of a step that lead to no waypoint

  void check() const {
    check_piece(pieces.cols(), out.x.size());
    check_linear(linear, out.x.size());
    check_values(waypoints.values.cols(), linear, out.x.size());
    check_at_least("pieces", pieces.rows(), 1);
    check_at_least("queue.what", queue.what.rows(), 1);
    check_at_least("waypoints.times", waypoints.times.size(), 1);
    check_at_least("waypoints.clock.seen_at", waypoints.clock.seen_at.size(), 1);
    check_index("piece", piece[0], most);
    check_index("taken", taken[0], most);
    check_index("late", late[0], most);
    check_index("refused", refused[0], most);
  }

  bool operator()(double t) {
    memory.set(linear, bounds);
    if (begun[0] == -infinite) now[0] = begun[0] = t;  // messages are taken later
    else if (t > now[0]) advance(t);
    present().state(t, memory.state);
    memory.state.copy_to(out);
    const bool stopped = age() > stop_after;
    if (stopped) out.x.setConstant(nothing);
    return !stopped && lost[0] == 0;
  }

  // Time since the last message, or since the run began [s].
  double age() const { return now[0] - std::max(received[0], begun[0]); }

  // Send a target; return whether it is valid.
  template <class Values> bool send_target(const Values& wanted) {
    if (!(wanted.cwiseAbs().array() <= largest).all()) return false;
    double norm = 1.0;
    if (linear != out.x.size()) {
      double sum = 0.0;  // in this order, as NumPy's
      for (Index i = wanted.size() - 4; i < wanted.size(); ++i) sum += wanted[i] * wanted[i];
      norm = std::sqrt(sum);
      if (std::abs(norm - 1.0) > unit) return false;
    }
    sent.target = wanted;
    if (std::abs(norm - 1.0) > 1e-15) sent.target.tail(4) /= norm;
    const bool moves = sent.moves[0] != 0, timed = sent.timed[0] != 0;
    const Index row = queue.add(MessageKind::TARGET, moves, timed, sent.time[0]);
    queue.values.row(row) = sent.target.transpose();
    queue.rates.row(row) = sent.rate.transpose();
    sent.moves[0] = sent.timed[0] = false;
    return true;
  }

  // Store the velocity of the next target; return whether it is valid.
  template <class Values> bool send_rate(const Values& wanted) {
    if (!(wanted.cwiseAbs().array() <= largest).all()) return false;
    sent.rate = wanted;
    sent.moves[0] = true;
    return true;
  }

  // Store the time of the next target; return whether it is valid.
  bool send_time(double wanted) {
    if (!(std::abs(wanted) <= latest)) return false;
    sent.time[0] = wanted;
    sent.timed[0] = true;
    return true;
  }

  // Send a velocity; return whether it is valid.
  template <class Values> bool send_velocity(const Values& wanted) {
    if (!(wanted.cwiseAbs().array() <= largest).all()) return false;
    sent.velocity = wanted;
    const Index row = queue.add(MessageKind::VELOCITY, true, false, 0.0);
    queue.rates.row(row) = sent.velocity.transpose();
    return true;
  }

 private:
  Piece present() {
    const Index row =
        static_cast<std::uint64_t>(piece[0]) % static_cast<std::uint64_t>(pieces.rows());
    return {pieces.row(row).data(), out.x.size()};
  }

  // Take the messages, each at its time, and go on.
  void advance(double t) {
    for (Index k = 0; k < queue.size();) {
      const double at = queue.taken_at(k);
      Index end = queue.end_of(k);
      while (end < queue.size() && queue.taken_at(end) == at) end = queue.end_of(end);
      step(at == -infinite ? t : std::max(at, now[0]), k, end);
      k = end;
    }
    queue.count[0] = 0;
    step(t, 0, 0);
    waypoints.forget(t, smoothing);
  }

  // Go on to a time at which the messages in rows [k, end) are taken.
  void step(double t, Index k, Index end) {
    now[0] = t;
    // Each piece but the last two leads to a waypoint, or fades. So there are no more of them; but
    // for times so large that a millisecond is rounded away.
    double due;
    for (Index steps = 0; (due = std::min(present().end(), fades_at[0])) <= t; ++steps) {
      if (steps > waypoints.times.size() + most_besides) return lose(t);
      if (due == fades_at[0] && commanded[0]) {
        velocity.setZero();
        fades_at[0] = infinite;
      }
      plan(due);
    }
    bool changed = false;
    for (Index next; k < end; k = next) {
      next = queue.end_of(k);
      changed |= accept(k, next, t);
    }
    const bool was = silent[0] != 0;
    silent[0] = age() > hold_after;
    if (changed || (silent[0] && !was)) plan(t);
  }

  // Take the message in rows [k, end); return whether it changes the future reference.
  bool accept(Index k, Index end, double t) {
    ++taken[0];
    received[0] = t;
    if (!waypoints.take(queue, k, end, t, delay, policy == LATEST)) {
      ++late[0];
      return false;
    }
    const bool was = commanded[0] != 0;
    commanded[0] = queue.is_velocity(k);
    fades_at[0] = infinite;
    if (!commanded[0]) return true;
    const bool of_tool = queue.kind(k) == MessageKind::TOOL_VELOCITY ||
                         (queue.kind(k) == MessageKind::VELOCITY && tool);
    const bool same =
        was && (in_tool[0] != 0) == of_tool && velocity == queue.rates.row(k).transpose();
    velocity = queue.rates.row(k).transpose();
    in_tool[0] = of_tool;
    fades_at[0] = t + dead_man;
    return !same || silent[0];
  }

  // Begin another piece.
  void plan(double t) {
    OwnState& state = memory.state;
    Planner& planner = memory.planner;
    present().state(t, state);
    rebase(state, static_cast<Index>(linear));
    // One that began now was replaced before anything could see it.
    if (present().start() != t) ++piece[0];
    if (next(t, planner, state)) return;
    ++refused[0];  // too far away for a motion
    commanded[0] = false;
    fades_at[0] = infinite;
    waypoints.clear();
    Piece following = present();
    if (!planner.to_rest(t, state, delay, following)) lose(t);
  }

  bool next(double t, Planner& planner, const OwnState& state) {
    Piece following = present();
    if (commanded[0] && !silent[0]) {
      memory.velocity = velocity;
      const bool of_tool = in_tool[0] && has_tool();
      return planner.follow(t, state, memory.velocity, of_tool, delay, following);
    }
    if (silent[0] || waypoints.size() == 0) return planner.to_rest(t, state, delay, following);
    const Index first = waypoints.near(t, smoothing), end = waypoints.near_end(t);
    const Index last = waypoints.size() - 1;
    const Waypoints way{{waypoints.times.data() + first, end - first},
                        {waypoints.values.row(first).data(), end - first, planner.width()},
                        {waypoints.rates.row(first).data(), end - first, out.x.size()},
                        waypoints.given.data() + first,
                        end <= last,
                        policy != EXTRAPOLATE && !waypoints.given[last]};
    return passing.plan(planner, t, state, way, {delay, smoothing, extrapolation}, following);
  }

  // Whether velocities have body axes that are not the world's: those of a pose or a rotation.
  bool has_tool() const { return linear == 0.0 || (linear == 3.0 && out.x.size() == 6); }

  // No reference is finite from now on.
  void lose(double t) {
    lost[0] = true;
    fades_at[0] = infinite;
    Piece none = present();
    none.begin(PieceForm::COAST, t, infinite, memory.state.base);
    none.body().setConstant(nothing);
  }
};

}  // namespace hsp
