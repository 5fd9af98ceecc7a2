#include "waypoints.hpp"

#include <algorithm>

namespace hsp {

namespace {

constexpr double apart =
    0.01;  // between neighbours for derivatives [s]; closer ones differ by noise
// Share of the largest norm below which a polynomial at the waypoints is rounding errors.
constexpr double rounding = 1e-13;

// The first waypoint that is not before a time, and the first after it.
Index from(const Eigen::Map<const Vector>& times, double t) {
  return std::lower_bound(times.data(), times.data() + times.size(), t) - times.data();
}
Index after(const Eigen::Map<const Vector>& times, double t) {
  return std::upper_bound(times.data(), times.data() + times.size(), t) - times.data();
}

void rest(OwnGoal& goal) {
  goal.rate.setZero();
  goal.acceleration.setZero();
}

}  // namespace

void Passing::resize(Index most, Index n) {
  x_.setZero(most, n);
  before_.setZero(n);
  for (OwnGoal* goal : {&goal_, &met_})
    for (Vector* each : {&goal->x, &goal->rate, &goal->acceleration}) each->setZero(n);
}

bool Passing::plan(Planner& planner, double t, const OwnState& state, const Waypoints& way,
                   const PassingTimes& how, Piece& piece) {
  const Index last = way.times.size() - 1, ahead = after(way.times, t);
  if (last == 0 && !way.more && way.rests)
    return planner.to_target(t, state, way.values.data(), way.times[0], how.delay, piece);
  localize(planner, way, state.base);
  // The next ones are tried closely, later ones more widely.
  Index tried = 0;
  for (Index k = ahead; k <= last; k += 1 + tried * tried / 8) {
    pass(planner, way, state.base, k, how.smoothing);
    if (k == ahead && k == last && way.rests) rest(goal_);  // no message continues it
    if (planner.smooth(t, state, goal_, piece)) return true;
    ++tried;
  }
  pass(planner, way, state.base, last, how.smoothing);
  const double end = goal_.time + (way.rests ? 0.0 : how.extrapolation);
  if ((goal_.rate.array() != 0.0).any()) {
    if (t < end) return meet(planner, t, state, how.delay, end, piece);
    if (!way.rests) return planner.to_rest(t, state, how.delay, piece);
  }
  rest(goal_);
  return on_line(state, t) ? planner.to_rest(t, state, how.delay, piece)
                           : planner.fastest(t, state, goal_, piece);
}

void Passing::localize(const Planner& planner, const Waypoints& way, const Matrix3& base) {
  for (Index k = 0; k < way.times.size(); ++k) {
    planner.local(way.values.row(k).data(), base, goal_.x);
    if (k > 0) planner.continue_from(before_, goal_.x);
    x_.row(k) = goal_.x.transpose();
    before_ = goal_.x;
  }
}

// Waypoint k as a goal, with given or estimated derivatives.
void Passing::pass(const Planner& planner, const Waypoints& way, const Matrix3& base, Index k,
                   double smoothing) {
  goal_.time = way.times[k];
  goal_.x = x_.row(k).transpose();
  rest(goal_);
  const Index count = way.times.size();
  if (way.given && way.given[k]) {
    goal_.rate = way.velocities.row(k).transpose();
    planner.local_rate(goal_.x, base, goal_.rate);
    return;
  }
  if (count == 1) return;
  const Index begin = from(way.times, way.times[k] - smoothing),
              end = from(way.times, way.times[k] + smoothing);
  if (smoothing > 0.0 && end - begin > 3) parabola(way, k, begin, end);
  else neighbours(way, k);
  if (k == count - 1 && !way.more) goal_.acceleration.setZero();
}

// The parabola through a waypoint and its two neighbours; a line where there is but one.
void Passing::neighbours(const Waypoints& way, Index k) {
  const auto& times = way.times;
  const Index last = times.size() - 1;
  const Index i = std::min(after(times, times[k] - apart) - 1, k - 1);
  const Index j = std::max(from(times, times[k] + apart), k + 1);
  if (i >= 0 && j <= last) {
    const double behind = times[k] - times[i], ahead = times[j] - times[k];
    for (Index c = 0; c < x_.cols(); ++c) {
      const double back = (x_(k, c) - x_(i, c)) / behind, forth = (x_(j, c) - x_(k, c)) / ahead;
      goal_.rate[c] = (ahead * back + behind * forth) / (behind + ahead);
      goal_.acceleration[c] = 2.0 * (forth - back) / (behind + ahead);
    }
    return;
  }
  const Index first = std::max<Index>(i, 0), end = std::min(j, last);
  goal_.rate = (x_.row(end) - x_.row(first)).transpose() / (times[end] - times[first]);
}

// The least-squares parabola of some waypoints, about waypoint k (Savitzky and Golay): a sum of the
// polynomials 1, p₁ = s - a₀ and p₂ = (s - a₁) p₁ - b₁ that are orthogonal at them (Forsythe).
void Passing::parabola(const Waypoints& way, Index k, Index begin, Index end) {
  const double scale = std::max(way.times[k] - way.times[begin], way.times[end - 1] - way.times[k]);
  const auto s = [&](Index i) { return (way.times[i] - way.times[k]) / scale; };
  const double count = static_cast<double>(end - begin);
  double a0 = 0.0, a1 = 0.0, size1 = 0.0, size2 = 0.0;
  for (Index i = begin; i < end; ++i) a0 += s(i) / count;
  const auto p1 = [&](Index i) { return s(i) - a0; };
  for (Index i = begin; i < end; ++i) size1 += p1(i) * p1(i);
  for (Index i = begin; i < end; ++i) a1 += s(i) * p1(i) * p1(i) / size1;
  const double b1 = size1 / count;
  const auto p2 = [&](Index i) { return (s(i) - a1) * p1(i) - b1; };
  for (Index i = begin; i < end; ++i) size2 += p2(i) * p2(i);
  const bool curved = size2 > rounding * rounding * count;  // otherwise there are two times
  for (Index c = 0; c < x_.cols(); ++c) {
    double c0 = 0.0, c1 = 0.0, c2 = 0.0;
    for (Index i = begin; i < end; ++i) {
      c0 += x_(i, c) / count;
      c1 += p1(i) * x_(i, c) / size1;
      if (curved) c2 += p2(i) * x_(i, c) / size2;
    }
    goal_.x[c] = c0 - a0 * c1 + (a0 * a1 - b1) * c2;
    goal_.rate[c] = (c1 - (a0 + a1) * c2) / scale;
    goal_.acceleration[c] = 2.0 * c2 / (scale * scale);
  }
}

// A piece that meets a moving goal, in `delay` or later.
bool Passing::meet(Planner& planner, double t, const OwnState& state, double delay, double end,
                   Piece& piece) {
  if (on_line(state, t)) {
    piece.begin(PieceForm::COAST, t, end, state.base);
    piece.body().row(0) = state.x.transpose();
    piece.body().row(1) = state.rate.transpose();
    return true;
  }
  const double soon = t + delay;
  if (soon <= end) {
    met_.time = soon;
    met_.x = goal_.x + (soon - goal_.time) * goal_.rate;
    met_.rate = goal_.rate;
    met_.acceleration = goal_.acceleration;
    if (planner.smooth(t, state, met_, piece)) return true;
  }
  if (!planner.fastest(t, state, goal_, piece)) return false;
  piece.end() = std::min(piece.end(), end);  // unless a message determines how it continues
  return true;
}

// Whether a state moves with the goal already.
bool Passing::on_line(const OwnState& state, double t) const {
  const double elapsed = t - goal_.time;
  for (Index i = 0; i < state.x.size(); ++i) {
    const double x = goal_.x[i] + elapsed * goal_.rate[i];
    if (!(std::abs(state.x[i] - x) < same_state &&
          std::abs(state.rate[i] - goal_.rate[i]) < same_state &&
          std::abs(state.acceleration[i]) < same_state))
      return false;
  }
  return true;
}

}  // namespace hsp
