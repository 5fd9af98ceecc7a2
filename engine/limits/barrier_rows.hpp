// Rows A a ≥ least of barriers in each step, and whether the unconstrained acceleration meets them.
#pragma once
#include <algorithm>
#include <hsp/indices.hpp>
#include <limits>
#include <stdexcept>

#include "records.hpp"

namespace hsp {

// Of the rows the first `number` are used.
template <template <int...> class As, template <int...> class Counts> struct BarrierRows {
  Counts<1> number;
  As<'r', 'n'> A;
  As<'r'> least;

  // The index of an additional row. Throws std::length_error if there is none.
  Index next() {
    if (number[0] < 0 || number[0] >= least.size())
      throw std::length_error("a barrier has more rows than are reserved");
    return number[0]++;
  }
  Index used() const { return std::clamp<Index>(number[0], 0, least.size()); }
};

struct Clear {
  static constexpr const char* doc = "Remove all rows.";
  OutInts<1> number;

  void operator()() { number.setZero(); }
};

struct CheckRows {
  static constexpr const char* doc = "Compare a with the rows, after CheckLimits.";
  BarrierRows<In, Ints> rows;
  In<'n'> a;
  LimitsOutcome<InOutInts> outcome;

  void operator()() {
    for (Index r = 0; r < rows.used(); ++r)
      if (!(rows.A.row(r).dot(a) >= rows.least[r])) outcome.rows[0] = outcome.violated[0] = 1;
  }
};

struct PlaceRows {
  static constexpr const char* doc =
      "Write the rows into a QP in the difference from a; those that are not used bind nothing.";
  BarrierRows<In, Ints> rows;
  In<'n'> a;
  Out<'r', 'w'> A;
  OutInts<'r'> end;  // of the entries of each row that are not 0
  Out<'r'> lower;

  void check() const { check_at_least("the columns of A", A.cols(), a.size()); }
  void operator()() {
    const Index used = rows.used(), n = a.size();
    for (Index r = 0; r < used; ++r) {
      A.row(r).head(n) = rows.A.row(r);
      lower[r] = rows.least[r] - rows.A.row(r).dot(a);
    }
    end.head(used).setConstant(n);
    end.tail(end.size() - used).setZero();
    lower.tail(lower.size() - used).setConstant(-std::numeric_limits<double>::infinity());
  }
};

}  // namespace hsp
