// The pieces of a reference that Python plans: it chooses the goals, these the motion.
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

struct RebasedState {
  static constexpr const char* doc =
      "The same state about its own orientation, where its rotation vector is zero.";
  double linear;  // number of coordinates outside of a rotation vector
  ChartState<In> state;
  ChartState<Out> out;
  StateMemory found;

  void check() const { check_linear(linear, state.x.size()); }
  void operator()() {
    found = state;
    rebase(found, static_cast<Index>(linear));
    found.copy_to(out);
  }
};

struct WaypointPiece {
  static constexpr const char* doc =
      "Through waypoints, each with its given derivatives, or those estimated from its "
      "its "
      "neighbours; whether there is a way.";
  double t, linear, delay, smoothing, extrapolation;
  double more, rests;  // 1 or 0; see `Waypoints`
  MotionBounds<In> bounds;
  ChartState<In> state;
  In<'m'> times;        // increasing [s]
  In<'m', 'w'> values;  // linear coordinates, then perhaps a quaternion (x, y, z, w)
  In<'m', 'n'> velocities;
  Flags<'m'> given;  // which velocities are given
  Out<'p'> piece;
  PlannerMemory memory;
  PassingMemory<'m'> passing;

  void check() const {
    check_piece(piece.size(), state.x.size());
    check_linear(linear, state.x.size());
    check_at_least("times", times.size(), 1);
    check_values(values.cols(), linear, state.x.size());
  }
  bool operator()() {
    memory.set(linear, bounds);
    memory.state = state;
    const Waypoints way{{times.data(), times.size()},
                        {values.data(), values.rows(), values.cols()},
                        {velocities.data(), velocities.rows(), velocities.cols()},
                        given.data(),
                        more != 0.0,
                        rests != 0.0};
    Piece out(piece.data(), state.x.size());
    return passing.plan(memory.planner, t, memory.state, way, {delay, smoothing, extrapolation},
                        out);
  }
};

struct VelocityPiece {
  static constexpr const char* doc =
      "To a velocity, and on with it: 0 if no motion is found, 1; 2 if x is the integral "
      "of u, x' = R u.";
  double t, linear, tool, delay;  // tool: 1 where the velocity is in the body's axes
  MotionBounds<In> bounds;
  ChartState<In> state;
  In<'n'> velocity;
  Out<'p'> piece;
  PlannerMemory memory;

  void check() const {
    check_piece(piece.size(), state.x.size());
    check_linear(linear, state.x.size());
    if (tool != 0.0 && linear != 0.0 && (linear != 3.0 || state.x.size() != 6))
      throw std::invalid_argument("only a piece with a rotation has axes of its own");
  }
  double operator()() {
    memory.set(linear, bounds);
    memory.state = state;
    memory.velocity = velocity;
    Piece out(piece.data(), state.x.size());
    return static_cast<double>(
        memory.planner.follow(t, memory.state, memory.velocity, tool != 0.0, delay, out));
  }
};

}  // namespace hsp
