// A reference that passes through waypoints, with given or estimated derivatives.
#pragma once
#include "planner.hpp"

namespace hsp {

// Waypoints in order of time: some passed ones, and the next ones.
struct Waypoints {
  Eigen::Map<const Vector> times;       // increasing [s]
  Eigen::Map<const Matrix> values;      // linear coordinates, then perhaps a quaternion
  Eigen::Map<const Matrix> velocities;  // in world axes, if given
  const bool* given;                    // null: nowhere
  bool more;                            // whether others follow these
  bool rests;  // whether the reference comes to rest at the last one, and does not go on beyond it
};

struct PassingTimes {
  double delay;          // delay of the reference after a waypoint's time [s]
  double smoothing;      // waypoints not farther in time are smoothed by a parabola [s]
  double extrapolation;  // time for which the reference continues at the last velocity [s]
};

class Passing {
 public:
  // Make room for so many waypoints of n coordinates.
  void resize(Index most, Index n);
  // Write the piece through the waypoints; return whether there is one.
  bool plan(Planner& planner, double t, const OwnState& state, const Waypoints& way,
            const PassingTimes& how, Piece& piece);

 private:
  void localize(const Planner& planner, const Waypoints& way, const Matrix3& base);
  void pass(const Planner& planner, const Waypoints& way, const Matrix3& base, Index k,
            double smoothing);
  void neighbours(const Waypoints& way, Index k);
  void parabola(const Waypoints& way, Index k, Index begin, Index end);
  bool meet(Planner& planner, double t, const OwnState& state, double delay, double end,
            Piece& piece);
  bool on_line(const OwnState& state, double t) const;

  Matrix x_;  // the waypoints in local coordinates
  OwnGoal goal_, met_;
  Vector before_;
};

}  // namespace hsp
