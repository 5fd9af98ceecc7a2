// A state's move: valid t, q and v are copied, then the calls of a plan are made.
#pragma once
#include <hsp/indices.hpp>
#include <optional>

#include "plan.hpp"

namespace hsp {

struct Move {
  static constexpr const char* type_name = "Move";
  static constexpr const char* doc = "Run calls at the state set by `to`.";
  Shared<Plan> calls;
  In<1> origin;  // reading of the clock at time 0 [s]
  Out<1> time;   // since then [s]
  Out<'q'> q;
  Out<'n'> v;
  Ints<'u', 2> unit_blocks;  // start and size of the blocks of q with norm 1
  InOutInts<1> stamp;        // the number of moves

  void check() const {
    for (Index k = 0; k < unit_blocks.rows(); ++k) {
      check_index("unit_blocks", unit_blocks(k, 0), q.size() + 1);
      check_index("the sizes of unit_blocks", unit_blocks(k, 1), q.size() - unit_blocks(k, 0) + 1);
    }
  }
  // Throws unless arrays that will be passed to `to` have its sizes.
  template <class Q, class V> void check_moved_by(const Q& q_in, const V& v_in) const {
    if (q_in.size() != q.size() || v_in.size() != v.size())
      throw std::invalid_argument("q and v have other sizes than the state that they move");
  }
  double operator()(double t) { return calls->run(t); }

  // Copy q, v and the time since the origin, and make the calls; nothing, if not all are finite or
  // a norm is wrong.
  template <class Q, class V> std::optional<double> to(double t, const Q& q_in, const V& v_in) {
    if (!is_valid(t, q_in, v_in)) return std::nullopt;
    time[0] = t - origin[0];
    q = q_in;
    v = v_in;
    ++stamp[0];
    return calls->run(time[0]);
  }

  template <class Q, class V> bool is_valid(double t, const Q& q_in, const V& v_in) const {
    bool valid = std::isfinite(t + q_in.sum() + v_in.sum());
    for (Index k = 0; k < unit_blocks.rows(); ++k) {
      const double square = q_in.segment(unit_blocks(k, 0), unit_blocks(k, 1)).squaredNorm();
      valid = valid && std::abs(square - 1.0) < 2e-6;
    }
    return valid;
  }
};

}  // namespace hsp
