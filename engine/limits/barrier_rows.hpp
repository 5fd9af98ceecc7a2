// Rows A a ≥ least that barriers add in each step, and whether the wanted acceleration keeps them.
#pragma once
#include <algorithm>
#include <hsp/kind.hpp>

#include "check.hpp"

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
  static constexpr const char* doc =
      "Count the rows that are violated; return what `CheckLimits` does, or that one has to look.";
  In<2> of_bounds;  // what it returned; and what is violated
  BarrierRows<In, Ints> rows;
  In<'n'> a;
  InOutInts<1> violated;

  double operator()() {
    for (Index r = 0; r < rows.number[0]; ++r)
      violated[0] += !(rows.A.row(r).dot(a) >= rows.least[r]);
    return violated[0] ? std::max(of_bounds[0], LOOK) : of_bounds[0];
  }
};

}  // namespace hsp
