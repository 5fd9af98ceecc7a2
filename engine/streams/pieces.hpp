// The pieces of a reference that Python plans: it chooses the goals, these the motion.
#pragma once
#include <algorithm>
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
  // Plan from a state on, in the chart in which its rotation vector is zero.
  template <class Bounds, class State>
  void begin(double linear, const Bounds& bounds, const State& from) {
    set(linear, bounds);
    state = from;
    rebase(state, static_cast<Index>(linear));
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

struct WaypointPiece {
  static constexpr const char* doc =
      "The piece that goes on from a state at a time through waypoints, each with the derivatives "
      "that it was given, or that it shows with its neighbours; whether there is a way.";
  double linear, delay, smoothing, extrapolation;
  Flags<1> more, rests;  // see `Waypoints`
  MotionBounds<In> bounds;
  ChartState<In> state;
  Ints<1> count;        // how many waypoints there are
  In<'m'> times;        // increasing [s]
  In<'m', 'w'> values;  // linear coordinates, then perhaps a quaternion (x, y, z, w)
  In<'m', 'n'> velocities;
  Flags<'m'> given;  // which velocities are
  Out<'p'> piece;
  PlannerMemory memory;
  PassingMemory<'m'> passing;

  void check() const {
    check_piece(piece.size(), state.x.size());
    check_linear(linear, state.x.size());
    check_at_least("times", times.size(), 1);
    check_values(values.cols(), linear, state.x.size());
  }
  bool operator()(double t) {
    memory.begin(linear, bounds, state);
    const Index k = std::clamp<Index>(count[0], 1, times.size());
    const Waypoints way{{times.data(), k},
                        {values.data(), k, values.cols()},
                        {velocities.data(), k, velocities.cols()},
                        given.data(),
                        more[0],
                        rests[0]};
    Piece out(piece.data(), state.x.size());
    return passing.plan(memory.planner, t, memory.state, way, {delay, smoothing, extrapolation},
                        out);
  }
};

struct VelocityPiece {
  static constexpr const char* doc =
      "The piece that leads from a state at a time to a velocity, and on at it: 0 where there is "
      "no way, 1; 2 where x stands for the integral of u, x' = R u.";
  double linear, delay;
  Flags<1> tool;  // whether the velocity is in the body's axes
  MotionBounds<In> bounds;
  ChartState<In> state;
  In<'n'> velocity;
  Out<'p'> piece;
  PlannerMemory memory;

  void check() const {
    check_piece(piece.size(), state.x.size());
    check_linear(linear, state.x.size());
  }
  double operator()(double t) {
    memory.begin(linear, bounds, state);
    memory.velocity = velocity;
    Piece out(piece.data(), state.x.size());
    const bool turns = linear == 3.0 && state.x.size() == 6;  // else world axes will do
    return static_cast<double>(memory.planner.follow(
        t, memory.state, memory.velocity, tool[0] && (turns || linear == 0.0), delay, out));
  }
};

}  // namespace hsp
