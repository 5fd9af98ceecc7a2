// Pieces from a state to a target, or to a velocity, within bounds: quintics where they
// keep the bounds, and otherwise Ruckig's fastest motion.
#pragma once
#include "fastest.hpp"
#include "piece.hpp"

namespace hsp {

constexpr double shortest_motion = 1e-3;  // between different states [s]
constexpr double same_state = 1e-7;  // states that differ by less are the same, in x, x' and x''
// Share of an angular speed up to which motions are planned. A vector with components up to b/√3 is
// no longer than b; each piece has its own axes, and where one begins a component of ω may be
// beyond its bound while all of ω is not.
constexpr double planned_share = 0.95;

// The desired value of the reference at a time, and its motion there.
struct OwnGoal {
  double time;  // time [s]
  Vector x, rate, acceleration;
};

class Planner {
 public:
  void resize(Index n);
  template <class Numbers>
  void set(Index linear, const Numbers& speed, const Numbers& acceleration, const Numbers& jerk) {
    n_ = linear;
    bounds_.speed = speed;
    bounds_.acceleration = acceleration;
    bounds_.jerk = jerk;
  }
  bool turns() const { return n_ < size_; }
  Index width() const { return turns() ? n_ + 4 : n_; }  // numbers of a value: a quaternion last

  // A value in coordinates about a base.
  void local(const double* value, const Matrix3& base, Vector& x) const;
  // The rotation vector of an orientation nearest to that of other coordinates.
  void continue_from(const Vector& before, Vector& x) const;
  // x' at x for a velocity in world axes; a rotation vector's is y' = Jlog(y) exp(y)ᵀ R_bᵀ ω.
  void local_rate(const Vector& x, const Matrix3& base, Vector& rate) const;

  // The quintic that reaches a goal in time; whether the bounds permit it.
  bool smooth(double t, const OwnState& state, const OwnGoal& goal, Piece& piece);
  // The fastest motion to a goal, which continues to move at its velocity.
  bool fastest(double t, const OwnState& state, const OwnGoal& goal, Piece& piece);
  // To a velocity, linear, then angular, in world axes or the body's, and on with it; in `delay`
  // [s] if the bounds permit.
  bool follow(double t, const OwnState& state, const Vector& velocity, bool tool, double delay,
              Piece& piece);
  // To rest at a value, at a time or later.
  bool to_target(double t, const OwnState& state, const double* value, double time, double delay,
                 Piece& piece);
  bool to_rest(double t, const OwnState& state, double delay, Piece& piece);

 private:
  bool keeps_box(const Matrix& ends, double duration);
  bool keeps(const Matrix& ends, double duration);
  void quintic(double t, double duration, const Matrix3& base, Piece& piece) const;
  void bound_velocity(const Vector& velocity, Vector& out) const;
  double share(const Vector& change, const Vector& bound) const;
  double shortest(const Vector& change, double delay) const;
  void change(const OwnState& state, const Vector& rate, bool tool, double T);
  bool steady(const Vector& wanted, bool tool, double T);
  double ball(const Vector& bound) const { return std::sqrt(3.0) * bound[bound.size() - 1]; }

  Index n_ = 0, size_ = 0;  // linear coordinates, and all
  OwnBounds bounds_;
  Fastest fastest_;
  FastestTask task_;
  OwnGoal goal_;
  OwnState seen_;
  Matrix ends_;  // x, T x', T² x'' at the start, then at the end
  Matrix points_;
  Vector wanted_, there_, apart_, moved_, x_, rate_, acceleration_, before_;
};

}  // namespace hsp
