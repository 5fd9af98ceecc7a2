// Rows A a ≥ least that barriers add in each step, and whether the wanted acceleration keeps them.
#pragma once
#include "records.hpp"

namespace hsp {

// Of the rows the first `number` are used.
template <template <int...> class As, template <int...> class Counts> struct BarrierRows {
  Counts<1> number;
  As<'r', 'n'> A;
  As<'r'> least;
};

struct Clear {
  static constexpr const char* doc = "Begin to count anew.";
  OutInts<1> number;

  void operator()() { number.setZero(); }
};

struct CheckRows {
  static constexpr const char* doc = "Compare a with the rows, after CheckLimits.";
  BarrierRows<In, Ints> rows;
  In<'n'> a;
  LimitsOutcome<InOutInts> outcome;

  void operator()() {
    for (Index r = 0; r < rows.number[0]; ++r)
      if (!(rows.A.row(r).dot(a) >= rows.least[r])) outcome.rows[0] = outcome.violated[0] = 1;
  }
};

}  // namespace hsp
