// The clock of whoever sends messages, compared with the controller's.
#pragma once
#include <algorithm>
#include <hsp/view.hpp>

namespace hsp {

// A message needs an unknown time to arrive; the fastest of the last ones shows the difference of
// the clocks best.
struct SenderClock {
  static constexpr double window = 2.0;   // over which clocks are compared [s]
  static constexpr double restart = 1.0;  // jump back of a clock that has restarted [s]

  InOut<1> newest;  // latest time of that clock [s]
  // When messages arrived, and how far that clock was behind then [s]: the second ones increase, in
  // a ring.
  InOut<'s'> seen_at, seen_behind;
  InOutInts<1> first, count;

  bool restarts_at(double time) const { return time < newest[0] - restart; }

  // A time of that clock on the controller's clock; its message has arrived now.
  double to_controller(double time, double now) {
    const Index size = seen_at.size();
    Index begin = std::clamp<Index>(first[0], 0, size - 1),
          seen = std::clamp<Index>(count[0], 0, size);
    if (restarts_at(time)) {
      seen = 0;
      newest[0] = time;
    }
    newest[0] = std::max(newest[0], time);
    while (seen > 0 && seen_at[begin] < now - window) {
      begin = (begin + 1) % size;
      --seen;
    }
    const double behind = now - time;  // later ones that are no smaller are never the smallest
    while (seen > 0 && seen_behind[(begin + seen - 1) % size] >= behind) --seen;
    if (seen == size) {
      begin = (begin + 1) % size;
      --seen;
    }
    const Index last = (begin + seen) % size;
    seen_at[last] = now;
    seen_behind[last] = behind;
    first[0] = begin;
    count[0] = seen + 1;
    return time + seen_behind[begin];
  }
};

}  // namespace hsp
