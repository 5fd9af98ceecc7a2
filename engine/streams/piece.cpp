#include "piece.hpp"

#include <hsp/linalg.hpp>

#include "../trajectories/orientations.hpp"
#include "../trajectories/polynomials.hpp"

namespace hsp {

namespace {

struct Sample {
  Vector &position, &velocity, &acceleration;
};
struct PoseNumbers {
  Vector6 position, velocity, acceleration;
};

// R, ω and ω' of a state, in world axes.
struct Turned {
  Matrix3 rotation;
  Vector3 angular_velocity, angular_acceleration;
};

Turned turned(const OwnState& state, Index linear) {
  struct {
    Vector3 position, velocity, acceleration;
  } y{state.x.segment<3>(linear), state.rate.segment<3>(linear),
      state.acceleration.segment<3>(linear)};
  const Turned at_rest{state.base, Vector3::Zero(), Vector3::Zero()};
  Turned found;
  turn_from(at_rest, y, found);
  return found;
}

// Gauss's quadrature with twelve points, symmetric about 0, on intervals in which a body turns by
// no more than this: the remainder is below rounding errors.
constexpr double turn = 0.2;  // [rad]
constexpr double points[] = {0.1252334085114689, 0.3678314989981802, 0.5873179542866175,
                             0.7699026741943047, 0.9041172563704748, 0.9815606342467192};
constexpr double weights[] = {0.2491470458134027,  0.2334925365383546,  0.20316742672306573,
                              0.16007832854334642, 0.10693932599531907, 0.04717533638651141};

}  // namespace

void rebase(OwnState& state, Index linear) {
  if (linear == state.x.size()) return;
  const Turned now = turned(state, linear);
  state.x.segment<3>(linear).setZero();
  state.rate.segment<3>(linear) = now.rotation.transpose() * now.angular_velocity;
  state.acceleration.segment<3>(linear) = now.rotation.transpose() * now.angular_acceleration;
  state.base = now.rotation;
}

void Piece::state(double t, OwnState& out) {
  const double elapsed = t - start();
  const auto rows = body();
  out.base = base();
  if (is(PieceForm::COAST) || is(PieceForm::TOOL_COAST)) {
    out.rate = rows.row(1).transpose();
    out.x = rows.row(0).transpose() + elapsed * out.rate;
    out.acceleration.setZero();
  } else if (is(PieceForm::QUINTIC) || is(PieceForm::TOOL_QUINTIC)) {
    Sample sample{out.x, out.rate, out.acceleration};
    polynomial(elapsed / duration(), duration(), rows.topRows<6>(), sample);
  } else {
    for (Index i = 0; i < n_; ++i) {
      Index k = phases - 1;
      while (k > 0 && !(rows(2 + 5 * k, i) <= elapsed)) --k;
      const Index row = 2 + 5 * k;
      const double s = std::max(elapsed - rows(row, i), 0.0), x = rows(row + 1, i),
                   v = rows(row + 2, i), a = rows(row + 3, i), j = rows(row + 4, i);
      out.x[i] = x + s * (v + s * (0.5 * a + s * j / 6.0)) + (rows(0, i) + elapsed * rows(1, i));
      out.rate[i] = v + s * (a + 0.5 * s * j) + rows(1, i);
      out.acceleration[i] = a + s * j;
    }
  }
  if (is(PieceForm::TOOL_COAST) || is(PieceForm::TOOL_QUINTIC)) to_world_axes(elapsed, out);
}

// x' = R u,  x'' = R u' + ω × R u, and x is the integral.
void Piece::to_world_axes(double elapsed, OwnState& out) {
  if (n_ != 6) return;
  const Turned now = turned(out, 3);
  out.x.head<3>() = body().row(0).head<3>().transpose() + moved(elapsed, out);
  out.rate.head<3>() = (now.rotation * out.rate.head<3>()).eval();
  out.acceleration.head<3>() = (now.rotation * out.acceleration.head<3>()).eval() +
                               now.angular_velocity.cross(out.rate.head<3>());
}

// ∫ R u ds from the start on; `now`: the end, before it is in world axes.
Vector3 Piece::moved(double elapsed, const OwnState& now) {
  if (is(PieceForm::TOOL_COAST)) {  // along a screw: ∫ exp(s ω) ds u
    const Vector3 u = now.rate.head<3>(), omega = now.rate.tail<3>();
    return elapsed * (now.base * (jexp3(-elapsed * omega) * u));
  }
  const double T = duration();
  const auto rows = body();
  PoseNumbers at;
  const auto velocity = [&](double s) -> Vector3 {
    polynomial(s / T, T, rows.topRows<6>(), at);
    return exp3(at.position.tail<3>()) * at.velocity.head<3>();
  };
  velocity(0.0);
  const double fastest = std::max(at.velocity.tail<3>().norm(), now.rate.tail<3>().norm());
  const double intervals = std::max(std::ceil(fastest * elapsed / turn), 1.0);
  if (!(intervals < 1e4)) return Vector3::Constant(std::nan(""));  // a damaged file
  const double half = 0.5 * elapsed / intervals;
  Vector3 sum = Vector3::Zero();
  for (double middle = half; middle < elapsed; middle += 2.0 * half)
    for (int k = 0; k < 6; ++k)
      sum +=
          weights[k] * (velocity(middle - half * points[k]) + velocity(middle + half * points[k]));
  return half * (now.base * sum);
}

}  // namespace hsp
