// Messages to a stream that the next step takes.
#pragma once
#include <algorithm>
#include <hsp/view.hpp>
#include <limits>

namespace hsp {

// Kinds of rows: a target; a velocity alone, in the stream's axes, in the world's or in the body's;
// a waypoint of a chunk, the first one or a later one.
enum class MessageKind : std::int64_t {
  TARGET,
  VELOCITY,
  WORLD_VELOCITY,
  TOOL_VELOCITY,
  CHUNK,
  CHUNK_GOES_ON
};

struct MessageQueue {
  InOutInts<1> count;
  InOutInts<'q', 3> what;  // `MessageKind`, whether there is a rate, whether there is a time
  InOut<'q', 3> times;     // see `sent_at`, `after`, `taken_at`
  InOut<'q', 'w'> values;
  InOut<'q', 'n'> rates;  // the velocity alone, or at the target, in world axes

  Index size() const { return std::clamp<Index>(count[0], 0, what.rows()); }
  MessageKind kind(Index k) const { return static_cast<MessageKind>(what(k, 0)); }
  bool moves(Index k) const { return what(k, 1) != 0; }
  bool timed(Index k) const { return what(k, 2) != 0; }
  double sent_at(Index k) const { return times(k, 0); }   // by the sender's clock [s]
  double after(Index k) const { return times(k, 1); }     // of a waypoint, after that [s]
  double taken_at(Index k) const { return times(k, 2); }  // [s]; -∞: when the next step is
  bool is_velocity(Index k) const {
    return MessageKind::VELOCITY <= kind(k) && kind(k) <= MessageKind::TOOL_VELOCITY;
  }
  // The row after the message that begins at one.
  Index end_of(Index k) const {
    Index end = k + 1;
    while (end < size() && kind(end) == MessageKind::CHUNK_GOES_ON) ++end;
    return end;
  }

  // Add a message in the next step at the end, in place of the oldest row where there is no more
  // room; return its row.
  Index add(MessageKind kind, bool moves, bool timed, double sent_at) {
    Index row = size();
    if (row == what.rows()) {
      --row;
      for (Index k = 0; k < row; ++k) {
        what.row(k) = what.row(k + 1);
        times.row(k) = times.row(k + 1);
        values.row(k) = values.row(k + 1);
        rates.row(k) = rates.row(k + 1);
      }
    }
    what.row(row) << static_cast<std::int64_t>(kind), moves, timed;
    times.row(row) << sent_at, 0.0, -std::numeric_limits<double>::infinity();
    count[0] = row + 1;
    return row;
  }
};

}  // namespace hsp
