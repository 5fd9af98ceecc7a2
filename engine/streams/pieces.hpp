// The pieces of a reference that Python plans: it decides where to, these say how.
#pragma once
#include <hsp/indices.hpp>

#include "planner.hpp"

namespace hsp {

// Bounds of the magnitudes of x', x'' and x''', for each coordinate.
template <template <int...> class As> struct MotionBounds {
  As<'n'> speed, acceleration, jerk;
};

// Where the reference should be at a time, and how it moves there.
template <template <int...> class As> struct StreamGoal {
  double time;
  As<'n'> x, rate, acceleration;
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

// What a call plans with, and on: no arguments.
struct PlannerMemory {
  Planner planner;
  StateMemory state;
  OwnGoal goal;
  Vector velocity;

  void prepare(const Sizes& size) {
    const Index n = size('n');
    planner.resize(n);
    state.resize(n);
    for (Vector* each : {&goal.x, &goal.rate, &goal.acceleration, &velocity}) each->setZero(n);
  }
  template <class Bounds> void set(double linear, const Bounds& bounds) {
    planner.set(static_cast<Index>(linear), bounds.speed, bounds.acceleration, bounds.jerk);
  }
};

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
      "The same state about the orientation that it has, where its rotation vector is zero.";
  double linear;  // how many coordinates are none of a rotation vector
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

struct SmoothPiece {
  static constexpr const char* doc =
      "The quintic that reaches a goal in time; whether the bounds permit it.";
  double t, linear;
  MotionBounds<In> bounds;
  ChartState<In> state;
  StreamGoal<In> goal;
  Out<'p'> piece;
  PlannerMemory memory;

  void check() const {
    check_piece(piece.size(), state.x.size());
    check_linear(linear, state.x.size());
  }
  bool operator()() {
    memory.set(linear, bounds);
    memory.state = state;
    memory.goal = {goal.time, goal.x, goal.rate, goal.acceleration};
    Piece out(piece.data(), state.x.size());
    return memory.planner.smooth(t, memory.state, memory.goal, out);
  }
};

struct FastestPiece {
  static constexpr const char* doc =
      "The fastest way to a goal, which goes on moving at its velocity; whether there is one.";
  double t, linear;
  MotionBounds<In> bounds;
  ChartState<In> state;
  StreamGoal<In> goal;
  Out<'p'> piece;
  PlannerMemory memory;

  void check() const {
    check_piece(piece.size(), state.x.size());
    check_linear(linear, state.x.size());
  }
  bool operator()() {
    memory.set(linear, bounds);
    memory.state = state;
    memory.goal = {goal.time, goal.x, goal.rate, goal.acceleration};
    Piece out(piece.data(), state.x.size());
    return memory.planner.fastest(t, memory.state, memory.goal, out);
  }
};

struct TargetPiece {
  static constexpr const char* doc =
      "To rest at a value, at a time or as soon as the bounds permit; whether there is a way.";
  double t, linear, time, delay;
  MotionBounds<In> bounds;
  ChartState<In> state;
  In<'w'> value;  // linear coordinates, then perhaps a quaternion (x, y, z, w)
  Out<'p'> piece;
  PlannerMemory memory;

  void check() const {
    check_piece(piece.size(), state.x.size());
    check_linear(linear, state.x.size());
    check_at_least("value", value.size(),
                   linear == state.x.size() ? state.x.size() : state.x.size() + 1);
  }
  bool operator()() {
    memory.set(linear, bounds);
    memory.state = state;
    Piece out(piece.data(), state.x.size());
    return memory.planner.to_target(t, memory.state, value.data(), time, delay, out);
  }
};

struct VelocityPiece {
  static constexpr const char* doc =
      "To a velocity, and on at it: 0 where there is no way, 1; 2 where x stands for the integral "
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
      throw std::invalid_argument("only what turns has axes of its own");
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
