// Memory for planning pieces, and a piece alone.
#pragma once
#include <hsp/indices.hpp>

#include "waypoints.hpp"

namespace hsp {

// Bounds of the magnitudes of x', x'' and x''', for each coordinate.
template <template <int...> class As> struct MotionBounds {
  As<'n'> speed, acceleration, jerk;
};

struct StateMemory : OwnState {
  void prepare(const Sizes& size) { resize(size('n')); }
  using OwnState::operator=;
  template <class State> void copy_to(State& out) const {
    out.x = x;
    out.rate = rate;
    out.acceleration = acceleration;
    out.base = base;
  }
};

// Memory of a call for planning.
struct PlannerMemory {
  Planner planner;
  StateMemory state;
  Vector velocity;

  void prepare(const Sizes& size) {
    const Index n = size('n');
    planner.resize(n);
    state.resize(n);
    velocity.setZero(n);
  }
  template <class Bounds> void set(double linear, const Bounds& bounds) {
    planner.set(static_cast<Index>(linear), bounds.speed, bounds.acceleration, bounds.jerk);
  }
};

// Room for so many waypoints.
template <int most> struct PassingMemory : Passing {
  void prepare(const Sizes& size) { resize(size(most), size('n')); }
};

inline void check_values(Index width, double linear, Index n) {
  check_at_least("values", width, linear == n ? n : n + 1);
}

inline void check_linear(double linear, Index n) {
  if (n < 1 || (linear != n && (n < 3 || linear != n - 3)))
    throw std::invalid_argument("linear needs n, or n - 3 where a rotation follows");
}

struct PieceState {
  static constexpr const char* doc = "x, x' and x'' of a piece at a time, in its coordinates.";
  In<'p'> piece;
  ChartState<Out> out;
  StateMemory found;

  void check() const { check_piece(piece.size(), out.x.size()); }
  void operator()(double t) {
    Piece(const_cast<double*>(piece.data()), out.x.size()).state(t, found);
    found.copy_to(out);
  }
};

}  // namespace hsp
