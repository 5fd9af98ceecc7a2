// The feedback of a task, Kv e' + Kp s(e) + offset.
#pragma once
#include <hsp/records.hpp>
#include <stdexcept>

namespace hsp {

// s(e) is e with each bounded part, such as its position, shortened to its largest length ℓ:
// s(e) = e if no part is longer.
template <int m = 'm'> struct Feedback {
  In<m, m> Kp, Kv;     // [1/s²], [1/s]
  In<m> offset;        // [m/s² or rad/s²]
  In<'p', 3> largest;  // of each bounded part: its first row, the row after its last, and ℓ

  void check() const {
    for (Index part = 0; part < largest.rows(); ++part) {
      const double first = largest(part, 0), end = largest(part, 1);
      const double rows = static_cast<double>(offset.size());
      if (!(0.0 <= first && first <= end && end <= rows))
        throw std::invalid_argument("a bounded part has rows that the error does not have");
    }
  }

  // a += Kv e' + Kp s(e) + offset
  template <class E, class R, class A> void add_to(A& a, const E& e, const R& e_dot) const {
    a += offset + Kv.lazyProduct(e_dot);
    add_pull_to(a, e);
  }

  // a += Kp s(e), the feedback's command at rest
  template <class E, class A> void add_pull_to(A& a, const E& e) const {
    a += Kp.lazyProduct(e);
    for (Index part = 0; part < largest.rows(); ++part) {
      const auto [first, size, longest] = bound(part);
      const double length = e.segment(first, size).norm();
      if (length > longest)
        a -= (1.0 - longest / length) *
             Kp.middleCols(first, size).lazyProduct(e.segment(first, size));
    }
  }

  struct Bound {
    Index first, size;
    double longest;
  };
  Bound bound(Index part) const {
    const Index first = static_cast<Index>(largest(part, 0));
    return {first, static_cast<Index>(largest(part, 1)) - first, largest(part, 2)};
  }
};

struct FeedbackAcceleration {
  static constexpr const char* doc = "Kv e' + Kp s(e) + offset.";
  Feedback<> feedback;
  In<'m'> e, e_dot;
  Out<'m'> out;

  void operator()() {
    out.setZero();
    feedback.add_to(out, e, e_dot);
  }
};

struct DemandAtRest {
  static constexpr const char* doc =
      "Kp s(e), and of each row of a bounded part that part's length relative to its largest.";
  Feedback<> feedback;
  In<'m'> e;
  Out<'m'> demand, stretched;

  void operator()() {
    demand.setZero();
    feedback.add_pull_to(demand, e);
    for (Index part = 0; part < feedback.largest.rows(); ++part) {
      const auto [first, size, longest] = feedback.bound(part);
      stretched.segment(first, size).setConstant(e.segment(first, size).norm() / longest);
    }
  }
};

}  // namespace hsp
