// Waypoints on the controller's clock, in order of time: those that messages have given.
#pragma once
#include <algorithm>
#include <hsp/view.hpp>
#include <limits>

#include "message_queue.hpp"
#include "sender_clock.hpp"

namespace hsp {

struct KnownWaypoints {
  static constexpr double kept = 1.0;       // how long those that were passed are [s]
  static constexpr Index considered = 256;  // before and after a time

  InOutInts<1> count;
  InOut<'k'> times;  // [s]
  InOut<'k', 'w'> values;
  InOut<'k', 'n'> rates;                              // their velocities, if given
  View<bool, Access::InOut, Order::Rows, 'k'> given;  // whether they are
  InOut<1> made;                                      // time of the newest message [s]
  InOut<1> superseded;                                // earlier messages are ignored [s]
  SenderClock clock;

  Index size() const { return std::clamp<Index>(count[0], 0, times.size()); }
  double last() const { return times[size() - 1]; }
  // The first one that is not before a time, and the first after it.
  Index from(double t) const { return std::lower_bound(begin(), begin() + size(), t) - begin(); }
  Index after(double t) const { return std::upper_bound(begin(), begin() + size(), t) - begin(); }
  // Those that matter at a time: the first, and the one after the last.
  Index near(double t, double smoothing) const {
    const Index ahead = after(t);
    const Index first = std::min(from(t - smoothing), std::max<Index>(ahead - 3, 0));
    return std::max(first, ahead - considered);
  }
  Index near_end(double t) const { return std::min(after(t) + considered, size()); }

  // Take the message in rows [k, end) of a queue at a time [s]; whether it arrived early enough.
  bool take(const MessageQueue& queue, Index k, Index end, double now, double delay, bool latest) {
    double at = now;
    if (queue.timed(k)) {
      if (clock.restarts_at(queue.sent_at(k))) {
        clear();
        made[0] = superseded[0] = -std::numeric_limits<double>::infinity();
      }
      at = clock.to_controller(queue.sent_at(k), now);
    }
    const bool chunk = queue.kind(k) == MessageKind::CHUNK, alone = queue.is_velocity(k);
    const bool newer = latest || chunk || alone;  // it replaces the others
    if (at < (newer ? made[0] : superseded[0])) return false;
    const double due = at + delay;
    const bool passed = due + queue.after(end - 1) <= now && size() > 0 && last() > now;
    if (passed && !newer) return false;
    made[0] = std::max(at, made[0]);
    if (newer) superseded[0] = at;
    if (alone || latest) clear();
    else if (chunk) count[0] = after(now);
    if (!alone)
      for (; k < end; ++k) add(due + queue.after(k), queue, k);
    return true;
  }

  void forget(double t, double smoothing) {
    // The last one stays the goal.
    const Index old = std::min(from(t - kept), std::max<Index>(size() - 1, 0));
    drop(std::max(old, near(t, smoothing)));
  }

  void clear() { count[0] = 0; }

 private:
  const double* begin() const { return times.data(); }

  void add(double time, const MessageQueue& queue, Index row) {
    Index k = from(time);
    if (k == size() || times[k] != time) {
      if (size() == times.size()) {
        drop(1);
        k = std::max<Index>(k - 1, 0);
      }
      for (Index i = size(); i > k; --i) copy(i - 1, i);
      count[0] = size() + 1;
    }
    times[k] = time;
    values.row(k) = queue.values.row(row);
    rates.row(k) = queue.rates.row(row);
    given[k] = queue.moves(row);
  }

  void copy(Index k, Index to) {
    times[to] = times[k];
    values.row(to) = values.row(k);
    rates.row(to) = rates.row(k);
    given[to] = given[k];
  }

  void drop(Index gone) {
    if (gone == 0) return;
    const Index size = this->size();
    for (Index k = gone; k < size; ++k) copy(k, k - gone);
    count[0] = size - gone;
  }
};

}  // namespace hsp
