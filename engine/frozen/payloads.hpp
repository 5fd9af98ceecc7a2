// A robot's payloads, set by a program without Python: see `ChangePayload`.
#pragma once
#include <Eigen/Eigenvalues>
#include <hsp/indices.hpp>
#include <hsp/kind.hpp>

#include "../dynamics/dynamics.hpp"
#include "../trajectories/smooth_step.hpp"

namespace hsp {

struct BodyInJoint {
  static constexpr const char* doc =
      "The centre and the inertia about it of a body that is fixed to a frame, in a joint's axes.";
  In<3, 3> rotation, inertia;  // of the frame in the joint's axes; in the frame's axes
  In<3> position, center;
  Out<3> center_out;
  Out<3, 3> inertia_out;

  void operator()() {
    const Matrix3 R = rotation, I = inertia;
    const Vector3 c = center;
    center_out = R * c + position;
    inertia_out = R * I * R.transpose();
  }
};

struct Payloads {
  static constexpr const char* doc =
      "Set the bodies that a robot carries, each with a share while it is taken up or put down.";
  Shared<Dynamics> dynamics;
  Ints<'f'> joints;         // of the frames that may carry,
  In<'f', 3, 3> rotations;  // in their axes
  In<'f', 3> positions;
  InOut<'f', 10> asked;   // mass, centre, and xx xy xz yy yz zz of the inertia about it
  InOutInts<1> count;     // bodies that are carried, taken up or put down
  InOutInts<'k'> frames;  // the frame of each
  InOut<'k'> masses;
  InOut<'k', 3> centers;
  InOut<'k', 9> inertias;
  InOutInts<'k'> changes;  // their number: the first adds it, the others remove it
  InOut<'k', 'm'> starts, ramps;
  Scratch<1> carries;                     // whether the dynamics have payloads
  static constexpr double largest = 1e6;  // of a mass, a center, an inertia

  void check() const {
    check_indices("joints", joints, dynamics->joints(), 1);
    check_at_least("joints", joints.size(), std::min<Index>(frames.size(), 1));
    dynamics->make_room(frames.size());
    if (changes.size() != frames.size() || starts.cols() < 1)
      throw std::invalid_argument("there is no room for a change");
  }

  void operator()(double t) {
    const Index used = number();
    if (used == 0 && carries[0] == 0.0) return;
    carries[0] = used;
    dynamics->put_down();
    for (Index k = 0; k < used; ++k) {
      const Index frame = std::clamp<Index>(frames[k], 0, joints.size() - 1);
      const auto [share, rate, acceleration] = share_of(k, t);
      dynamics->carry({joints[frame], masses[k], centers.row(k).transpose(),
                       Eigen::Map<const Matrix3>(inertias.row(k).data()), share, rate,
                       acceleration});
    }
  }

  // Whether a frame may carry this.
  template <class Values> static bool permits(const Values& body) {
    if (!(body.cwiseAbs().array() <= largest).all() || body[0] < 0.0) return false;
    const Eigen::SelfAdjointEigenSolver<Matrix3> solver(moments(body), Eigen::EigenvaluesOnly);
    const Vector3 principal = solver.eigenvalues();
    const double rounding = 1e-9 * principal[2];
    return principal[0] >= -rounding && principal[0] + principal[1] - principal[2] >= -rounding &&
           !(body[0] == 0.0 && principal[2] > 0.0);
  }

  // Carry it from a time on, instead of the frame's present payload; returns whether there is room.
  template <class Values> bool then(Index frame, double t, double ramp, const Values& body) {
    settle(t);
    const Index used = number();
    if (body[0] > 0.0 && used == frames.size()) return false;
    for (Index k = 0; k < used; ++k)
      if (frames[k] == frame && number_of(k) == starts.cols()) return false;
    for (Index k = 0; k < used; ++k)
      if (frames[k] == frame) change(k, t, ramp);
    asked.row(frame) = body.transpose();
    if (body[0] == 0.0) return true;
    frames[used] = frame;
    masses[used] = body[0];
    changes[used] = 0;
    const Matrix3 R = rotations[frame], I = moments(body);
    const Vector3 c = body.template segment<3>(1);
    centers.row(used) = (R * c + positions.row(frame).transpose()).transpose();
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(inertias.row(used).data()) =
        R * I * R.transpose();
    change(used, t, ramp);
    ++count[0];
    return true;
  }

 private:
  Index number() const { return std::clamp<Index>(count[0], 0, frames.size()); }
  Index number_of(Index k) const { return std::clamp<Index>(changes[k], 0, starts.cols()); }

  void change(Index k, double t, double ramp) {
    starts(k, number_of(k)) = t;
    ramps(k, number_of(k)) = ramp;
    ++changes[k];
  }

  template <class Values> static Matrix3 moments(const Values& body) {
    Matrix3 I;
    I << body[4], body[5], body[6], body[5], body[7], body[8], body[6], body[8], body[9];
    return I;
  }

  // Its carried share, and the derivatives: see `Evolution`.
  SmoothStep share_of(Index k, double t) const {
    double x = 0.0, x_dot = 0.0, x_ddot = 0.0;
    for (Index i = 0; i < number_of(k); ++i) {
      const double start = starts(k, i), ramp = ramps(k, i), target = i == 0 ? 1.0 : 0.0;
      if (start > t) break;
      const auto step = ramp == 0.0 ? SmoothStep{1.0, 0.0, 0.0} : smooth_step(t, start, ramp);
      if (step.over()) {
        x = target;
        x_dot = x_ddot = 0.0;
      } else if (step.s > 0.0) {
        x_ddot = (1.0 - step.s) * x_ddot - 2.0 * step.s_dot * x_dot + step.s_ddot * (target - x);
        x_dot = (1.0 - step.s) * x_dot + step.s_dot * (target - x);
        x += step.s * (target - x);
      }
    }
    return {x, x_dot, x_ddot};
  }

  // Remove bodies that have been put down.
  void settle(double t) {
    Index kept = 0;
    for (Index k = 0; k < number(); ++k) {
      const Index last = number_of(k) - 1;
      if (last > 0 && starts(k, last) + ramps(k, last) <= t) continue;
      frames[kept] = frames[k];
      masses[kept] = masses[k];
      centers.row(kept) = centers.row(k);
      inertias.row(kept) = inertias.row(k);
      changes[kept] = changes[k];
      starts.row(kept) = starts.row(k);
      ramps.row(kept++) = ramps.row(k);
    }
    count[0] = kept;
  }
};

}  // namespace hsp
