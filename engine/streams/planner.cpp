#include "planner.hpp"

#include <array>
#include <hsp/linalg.hpp>
#include <limits>
#include <numbers>

#include "../trajectories/orientations.hpp"
#include "../trajectories/polynomials.hpp"

namespace hsp {

namespace {

// A quintic is cut into this many pieces: the bounds of a Bézier curve by its control points are
// then at most a tenth too cautious for a motion from rest to rest.
constexpr int cuts = 4;
constexpr int tries = 8;         // number of longer cubics that are tried,
constexpr double longer = 1.25;  // and their ratio: up to five times longer
constexpr int repeated = 40;     // a change by a radian needs some fifteen
constexpr double far = 2.0;      // rotation beyond which a change does not end steadily [rad]
constexpr double infinite = std::numeric_limits<double>::infinity();

// Map from control points to those of the piece from `start` to `end`: entry (i, j) is the blossom
// of Bernstein polynomial j at i times `end` and degree - i times `start`.
Matrix cut(int degree, double start, double end) {
  Matrix rows(degree + 1, degree + 1);
  for (int i = 0; i <= degree; ++i) {
    Vector ones = Vector::Zero(degree + 2);
    ones[0] = 1.0;
    for (int k = 0; k < degree; ++k) {
      const double u = k < i ? end : start;
      for (int j = k + 1; j > 0; --j) ones[j] = ones[j] * (1.0 - u) + ones[j - 1] * u;
      ones[0] *= 1.0 - u;
    }
    rows.row(i) = ones.head(degree + 1).transpose();
  }
  return rows;
}

// Map from the ends of a quintic to T^k times the control points of its k-th derivative.
std::array<Matrix, 3> derivatives() {
  Matrix points = Matrix::Zero(6, 6);
  points.topLeftCorner<3, 3>() << 1.0, 0.0, 0.0, 1.0, 1.0 / 5.0, 0.0, 1.0, 2.0 / 5.0, 1.0 / 20.0;
  points.bottomRightCorner<3, 3>() << 1.0, -2.0 / 5.0, 1.0 / 20.0, 1.0, -1.0 / 5.0, 0.0, 1.0, 0.0,
      0.0;
  std::array<Matrix, 3> found;
  for (int k = 1; k <= 3; ++k) {
    const int degree = 5 - k;
    const Matrix lower = points.topRows(degree + 1), upper = points.bottomRows(degree + 1);
    points = (degree + 1.0) * (upper - lower);
    found[k - 1].resize(cuts * (degree + 1), 6);
    for (int i = 0; i < cuts; ++i)
      found[k - 1].middleRows(i * (degree + 1), degree + 1) =
          cut(degree, double(i) / cuts, (i + 1.0) / cuts) * points;
  }
  return found;
}

const std::array<Matrix, 3> bezier = derivatives();

}  // namespace

void Planner::resize(Index n) {
  size_ = n;
  fastest_.resize(n);
  task_.resize(n);
  seen_.resize(n);
  ends_.setZero(6, n);
  points_.setZero(bezier[0].rows(), n);
  for (Vector* each :
       {&goal_.x, &goal_.rate, &goal_.acceleration, &bounds_.speed, &bounds_.acceleration,
        &bounds_.jerk, &wanted_, &there_, &apart_, &moved_, &x_, &rate_, &acceleration_, &before_})
    each->setZero(n);
}

void Planner::local(const double* value, const Matrix3& base, Vector& x) const {
  for (Index i = 0; i < n_; ++i) x[i] = value[i];
  if (!turns()) return;
  const Eigen::Vector4d quaternion(value[n_], value[n_ + 1], value[n_ + 2], value[n_ + 3]);
  x.segment<3>(n_) = log3(base.transpose() * rotation_from_quaternion(quaternion));
}

// y and y (1 - 2π/|y|) are the same rotation.
void Planner::continue_from(const Vector& before, Vector& x) const {
  if (!turns()) return;
  constexpr double turn = 2.0 * std::numbers::pi;
  auto y = x.segment<3>(n_);
  const double angle = y.norm();
  if (angle == 0.0) return;
  const double along = y.dot(before.segment<3>(n_)) / angle;
  y *= 1.0 - turn * std::nearbyint((angle - along) / turn) / angle;
}

void Planner::local_rate(const Vector& x, const Matrix3& base, Vector& rate) const {
  if (!turns()) return;
  const Vector3 y = x.segment<3>(n_), omega = rate.segment<3>(n_);
  rate.segment<3>(n_) = jlog3(y) * ((base * exp3(y)).transpose() * omega);
}

bool Planner::smooth(double t, const OwnState& state, const OwnGoal& goal, Piece& piece) {
  const double T = goal.time - t;
  if (T < shortest_motion) return false;
  ends_.row(0) = state.x.transpose();
  ends_.row(1) = T * state.rate.transpose();
  ends_.row(2) = T * T * state.acceleration.transpose();
  ends_.row(3) = goal.x.transpose();
  ends_.row(4) = T * goal.rate.transpose();
  ends_.row(5) = T * T * goal.acceleration.transpose();
  if (!keeps_box(ends_, T)) return false;
  quintic(t, T, state.base, piece);
  piece.end() = goal.time;
  return true;
}

// The derivatives are Bézier curves, between their control points: true is certain, false too
// cautious.
bool Planner::keeps_box(const Matrix& ends, double duration) {
  double scale = 1.0;
  const Vector* bounds[] = {&bounds_.speed, &bounds_.acceleration, &bounds_.jerk};
  for (int k = 0; k < 3; ++k) {
    scale *= duration;
    auto points = points_.topRows(bezier[k].rows());
    points.noalias() = bezier[k].lazyProduct(ends);
    for (Index i = 0; i < size_; ++i)
      if (greatest(points.col(i).cwiseAbs()) > (*bounds[k])[i] * scale) return false;
  }
  return true;
}

void Planner::quintic(double t, double duration, const Matrix3& base, Piece& piece) const {
  piece.begin(PieceForm::QUINTIC, t, t + duration, base);
  piece.duration() = duration;
  auto body = piece.body();
  const auto p = ends_.row(0), v = ends_.row(1), a = ends_.row(2);
  const auto P = ends_.row(3), V = ends_.row(4), A = ends_.row(5);
  body.row(0) = p;
  body.row(1) = v;
  body.row(2) = 0.5 * a;
  body.row(3) = 10.0 * (P - p) - 6.0 * v - 4.0 * V - 1.5 * a + 0.5 * A;
  body.row(4) = -15.0 * (P - p) + 8.0 * v + 7.0 * V + 1.5 * a - A;
  body.row(5) = 6.0 * (P - p) - 3.0 * (v + V) - 0.5 * (a - A);
}

// A goal at rest is reached at its time, or as soon as the bounds permit. Where the goal moves, a
// position does not wait for an orientation that is behind.
bool Planner::fastest(double t, const OwnState& state, const OwnGoal& goal, Piece& piece) {
  const Vector& speed = bounds_.speed;
  task_.drift = goal.rate.cwiseMax(-0.9 * speed).cwiseMin(0.9 * speed);
  const bool moves = (task_.drift.array() != 0.0).any();
  before_ = goal.x + (t - goal.time) * task_.drift;  // the origin of the frame
  task_.x = state.x - before_;
  task_.rate = state.rate - task_.drift;
  task_.acceleration = state.acceleration;
  task_.target_rate.setZero();
  task_.positions = true;
  task_.together = moves ? n_ : size_;
  task_.minimum = moves ? 0.0 : std::max(goal.time - t, 0.0);
  const double duration = fastest_.solve(task_, bounds_, piece);
  if (duration < 0.0) return false;
  piece.begin(PieceForm::FASTEST, t, t + std::max(duration, shortest_motion), state.base);
  auto body = piece.body();
  body.row(0) = before_.transpose();
  body.row(1) = task_.drift.transpose();
  return true;
}

bool Planner::to_target(double t, const OwnState& state, const double* value, double time,
                        double delay, Piece& piece) {
  goal_.time = time;
  local(value, state.base, goal_.x);
  goal_.rate.setZero();
  goal_.acceleration.setZero();
  if (time > t && smooth(t, state, goal_, piece)) return true;
  apart_ = (state.x - goal_.x).cwiseAbs().cwiseMax(state.rate.cwiseAbs());
  const bool there =
      greatest(apart_) < same_state && greatest(state.acceleration.cwiseAbs()) < same_state;
  return there ? to_rest(t, state, delay, piece) : fastest(t, state, goal_, piece);
}

bool Planner::to_rest(double t, const OwnState& state, double delay, Piece& piece) {
  goal_.rate.setZero();
  return follow(t, state, goal_.rate, false, delay, piece);
}

// A velocity changes along a cubic, so that all its components keep their ratio from one steady
// velocity to another: a hand never leaves its straight line or its screw. If no cubic keeps the
// bounds, an accelerating motion is first brought to a steady velocity; finally, in world axes,
// Ruckig plans the motion.
bool Planner::follow(double t, const OwnState& state, const Vector& velocity, bool tool,
                     double delay, Piece& piece) {
  bound_velocity(velocity, wanted_);
  seen_ = state;
  if (tool && n_) {  // u and u' in place of x' and x'': x'' = R (u' + ω × u)
    const Vector3 u = state.base.transpose() * state.rate.head<3>();
    const Vector3 omega = state.rate.segment<3>(n_);
    seen_.rate.head<3>() = u;
    seen_.acceleration.head<3>() =
        state.base.transpose() * state.acceleration.head<3>() - omega.cross(u);
  }
  there_ = wanted_;
  if (turns() && !tool) there_.segment<3>(n_) = state.base.transpose() * wanted_.segment<3>(n_);
  apart_ = there_ - seen_.rate;
  if (greatest(apart_.cwiseAbs()) < same_state &&
      greatest(seen_.acceleration.cwiseAbs()) < same_state) {
    const bool rests = !(wanted_.array() != 0.0).any();
    const bool turns_on = tool && n_ && !rests;
    piece.begin(turns_on ? PieceForm::TOOL_COAST : PieceForm::COAST, t, infinite, state.base);
    auto body = piece.body();
    body.row(0) = state.x.transpose();
    if (rests) body.row(1).setZero();
    else body.row(1) = seen_.rate.transpose();
    return true;
  }
  double T = shortest(apart_, delay);
  bool kept = false;
  for (int k = 0; k < tries && !kept; ++k) {
    change(seen_, there_, tool, T);
    kept = keeps(ends_, T);
    if (!kept) T *= longer;
  }
  if (!kept) {  // the acceleration must end first, since the stick was reversed
    T = std::max(shortest_motion, 2.0 * share(seen_.acceleration, bounds_.jerk)) * (1.0 + 1e-9);
    there_ = seen_.rate + T / 3.0 * seen_.acceleration;
    change(seen_, there_, tool, T);
    kept = keeps(ends_, T);
  }
  if (kept || tool) {
    quintic(t, T, state.base, piece);
    if (tool && n_) piece.set(PieceForm::TOOL_QUINTIC);
    return true;
  }
  task_.x = state.x;
  task_.rate = state.rate;
  task_.acceleration = state.acceleration;
  task_.target_rate = wanted_;
  if (turns()) task_.target_rate.segment<3>(n_) = state.base.transpose() * wanted_.segment<3>(n_);
  task_.drift.setZero();
  task_.positions = false;
  task_.together = size_;
  task_.minimum = 0.0;
  const double duration = fastest_.solve(task_, bounds_, piece);
  if (duration < 0.0) return false;
  piece.begin(PieceForm::FASTEST, t, t + std::max(duration, shortest_motion), state.base);
  piece.body().topRows<2>().setZero();
  return true;
}

// A velocity in its own direction, but not beyond the bounds.
void Planner::bound_velocity(const Vector& velocity, Vector& out) const {
  out = velocity;
  const auto ratios = out.head(n_).cwiseAbs().array() / bounds_.speed.head(n_).array();
  out.head(n_) /= std::max(1.0, greatest(ratios));
  if (turns()) out.segment<3>(n_) /= std::max(1.0, out.segment<3>(n_).norm() / ball(bounds_.speed));
}

// The largest ratio of a change to a bound; of a rotation vector that of their lengths.
double Planner::share(const Vector& change, const Vector& bound) const {
  double most = greatest(change.head(n_).cwiseAbs().array() / bound.head(n_).array());
  if (turns()) most = std::max(most, change.segment<3>(n_).norm() / ball(bound));
  return most;
}

// Duration of a change from one steady velocity to another: a cubic's largest
// acceleration is 1.5 Δ/T, its largest jerk 6 Δ/T².
double Planner::shortest(const Vector& change, double delay) const {
  double T = std::max({delay, shortest_motion, 1.5 * share(change, bounds_.acceleration)});
  T = std::max(T, std::sqrt(6.0 * share(change, bounds_.jerk)));
  return T * (1.0 + 1e-9);  // otherwise rounding decides
}

// The ends of a quintic whose velocity is a cubic. At its end the velocity is steady in its axes.
// The required motion of a rotation vector depends on its final value, which depends on the motion:
// `steady` iterates to a fixed point.
void Planner::change(const OwnState& state, const Vector& rate, bool tool, double T) {
  moved_ = 0.5 * T * state.rate;
  moved_ += state.x + T * T / 12.0 * state.acceleration;
  if (!turns() || !steady(rate, tool, T)) {
    x_ = moved_ + 0.5 * T * rate;
    rate_ = rate;
    acceleration_.setZero();
  }
  ends_.row(0) = state.x.transpose();
  ends_.row(1) = T * state.rate.transpose();
  ends_.row(2) = T * T * state.acceleration.transpose();
  ends_.row(3) = x_.transpose();
  ends_.row(4) = T * rate_.transpose();
  ends_.row(5) = T * T * acceleration_.transpose();
}

// x, x' and x'' with the desired steady angular velocity. If it is not found, after a large
// rotation, the next piece corrects the smaller remainder.
bool Planner::steady(const Vector& wanted, bool tool, double T) {
  rate_ = wanted;
  acceleration_.setZero();
  x_ = moved_ + 0.5 * T * rate_;
  for (int k = 0; k < repeated; ++k) {
    const Vector3 y = x_.segment<3>(n_);
    if (y.squaredNorm() > far * far) return false;
    const Matrix3 inverse = jlog3(y);
    const Vector3 omega = wanted.segment<3>(n_);
    Vector3 seen = omega;
    if (!tool) seen = exp3(y).transpose() * omega;
    const Vector3 turning = inverse * seen;
    rate_.segment<3>(n_) = turning;
    acceleration_.segment<3>(n_) = -(inverse * (jexp3_dot(y, turning) * turning));
    before_ = x_;
    x_ = moved_ + 0.5 * T * rate_ - T * T / 12.0 * acceleration_;
    if (greatest((x_ - before_).cwiseAbs()) < 1e-15) return true;
  }
  return false;
}

// As `keeps_box`, but the angular bounds hold for lengths. A velocity that is too high at the
// start, as may happen after a change of axes, may stay so until it has decreased.
bool Planner::keeps(const Matrix& ends, double duration) {
  double scale = 1.0;
  const Vector* bounds[] = {&bounds_.speed, &bounds_.acceleration, &bounds_.jerk};
  for (int k = 0; k < 3; ++k) {
    scale *= duration;
    auto points = points_.topRows(bezier[k].rows());
    points.noalias() = bezier[k].lazyProduct(ends);
    points /= scale;
    const auto within = [&](auto size, double bound) {
      double most = bound;
      if (k < 2) most = std::max(most, size(0));
      for (Index row = 0; row < points.rows(); ++row)
        if (size(row) > most * (1.0 + 1e-12)) return false;
      return true;
    };
    for (Index i = 0; i < n_; ++i)
      if (!within([&](Index row) { return std::abs(points(row, i)); }, (*bounds[k])[i]))
        return false;
    const auto length = [&](Index row) { return points.row(row).template segment<3>(n_).norm(); };
    if (turns() && !within(length, ball(*bounds[k]) / (k == 0 ? planned_share : 1.0))) return false;
  }
  return true;
}

}  // namespace hsp
