// The contribution of compensators to a step without Python.
#pragma once
#include <hsp/kind.hpp>

#include "../limits/acceleration_bounds.hpp"
#include "../limits/records.hpp"

namespace hsp {

struct OffsetEffort {
  static constexpr const char* doc =
      "The effort M a + N and an offset, and whether it, or an earlier check, violates a "
      "limit.";
  In<'n'> effort, offset, lower, upper;
  Out<'n'> wanted;
  LimitsOutcome<InOutInts> limits;

  void operator()() {
    wanted = effort + offset;
    limits.effort[0] = !is_within(wanted, lower, upper);
    limits.violated[0] = limits.motion[0] || limits.rows[0] || limits.effort[0];
  }
};

struct Subtract {
  static constexpr const char* doc = "out ← out - x.";
  In<'n'> x;
  InOut<'n'> out;

  void operator()() { out -= x; }
};

struct HasMoved {
  static constexpr const char* doc = "Whether a state differs from the last one.";
  InOutInts<1> stamp;

  void operator()() { ++stamp[0]; }
};

}  // namespace hsp
