// Contact forces: their map to generalised forces, those of minimum norm, friction cones.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/indices.hpp>
#include <hsp/linalg.hpp>
#include <hsp/records.hpp>
#include <hsp/rotations.hpp>

namespace hsp {

struct ForceMap {
  static constexpr const char* doc =
      "The points of a contact, and the generalised forces of unit forces at them.";
  // A force s at an arm r has the wrench (s, r × s): column Jᵀ(s, r × s).
  FrameMotion<In> frame;
  In<'k', 3> points;   // in the frame's axes
  In<3> shift;         // of all of them, in world axes
  In<3, 3> axes;       // directions of the unit forces, as columns
  std::int64_t first;  // index of the first of these points among all
  InOut<'a', 3> positions;
  InOut<'n', 'f'> out;  // three columns for each of all points

  void check() const {
    if (first < 0) throw std::invalid_argument("first is less than 0");
    check_at_least("positions", positions.rows(), first + points.rows());
    check_at_least("the columns of out", out.cols(), 3 * (first + points.rows()));
  }
  void operator()() {
    Eigen::Matrix<double, 6, 3> wrenches;
    wrenches.topRows<3>() = axes;
    for (Index k = 0; k < points.rows(); ++k) {
      const Vector3 arm = frame.rotation * points.row(k).transpose() + shift;
      wrenches.bottomRows<3>() = skew(arm) * axes;
      positions.row(first + k) = (frame.position + arm).transpose();
      out.middleCols<3>(3 * (first + k)) = frame.jacobian.transpose().lazyProduct(wrenches);
    }
  }
};

struct MinimumNormForces {
  static constexpr const char* doc =
      "f = r + E Aᵀ(A E Aᵀ)⁺(w - A r), of minimum Σ (f - r)²/e, and the remaining effort.";
  // A are the base's rows of F, E = diag(e), w the base's rows of the desired effort, and r the
  // commanded forces. w lies in the range of A: directions without support are omitted. The effort
  // of the base, which has no motor, is zero.
  In<'n', 'f'> F;
  Ints<'b'> base;
  In<'f'> inverse_cost, reference;  // e, r
  In<'n'> wanted;
  Out<'f'> forces;
  Out<'n'> tau;
  Scratch<'b', 'f'> A, AE;
  Scratch<'b', 'b'> G, U;
  Scratch<'b'> w, multipliers;

  void check() const { check_indices("base", base, tau.size()); }
  void operator()() {
    for (Index i = 0; i < base.size(); ++i) {
      A.row(i) = F.row(base[i]);
      w[i] = wanted[base[i]] - A.row(i).dot(reference);
    }
    AE = A * inverse_cost.asDiagonal();
    G = AE.lazyProduct(A.transpose());
    if (well_conditioned()) {
      multipliers = w;
      solve_lower(U, multipliers);
      solve_lower_transposed(U, multipliers);
    } else {
      least_squares();
    }
    forces = reference;
    forces.noalias() += AE.transpose() * multipliers;
    tau = wanted;
    tau.noalias() -= F * forces;
    for (Index i = 0; i < base.size(); ++i) tau[base[i]] = 0.0;
  }

 private:
  // Whether the Cholesky factor U of G is reliable: no pivot is so small relative to the largest
  // that a direction might lack support.
  bool well_conditioned() {
    constexpr double trusted = 1e-6;
    if (!cholesky(G, U)) return false;
    if (U.rows() == 0) return true;
    const double least = U.diagonal().minCoeff(), most = U.diagonal().maxCoeff();
    return least * least > trusted * most * most;
  }

  // multipliers = G⁺ w. G is symmetric and positive semidefinite: where U G has orthogonal rows
  // their lengths are its eigenvalues, and the rows of U its eigenvectors.
  void least_squares() {
    constexpr double negligible = 1e-10;  // relative to the largest eigenvalue: no support
    orthogonalise_rows(G, U);
    const double largest = std::sqrt(greatest(G.rowwise().squaredNorm()));
    multipliers.setZero();
    for (Index r = 0; r < G.rows(); ++r) {
      const double eigenvalue = G.row(r).norm();
      if (eigenvalue > negligible * largest)
        multipliers += U.row(r).dot(w) / eigenvalue * U.row(r).transpose();
    }
  }
};

struct CommandedForce {
  static constexpr const char* doc =
      "f_ref = w S F of a commanded force F at a contact's points, whose normal force pushes.";
  In<'c'> command;       // F [N, N·m]
  In<1> offset, weight;  // added to the normal force [N]; w in [0, 1]
  In<'f', 'c'> shares;   // S, from coordinates of F to the forces at the points
  std::int64_t normal;   // index of the normal force
  Out<'f'> reference;
  Scratch<'c'> pushing;

  void check() const { check_index("normal", normal, command.size()); }
  void operator()() {
    pushing = command;
    pushing[normal] = std::max(pushing[normal] + offset[0], 0.0);
    reference = weight[0] * shares.lazyProduct(pushing);
  }
};

struct WrenchShares {
  static constexpr const char* doc =
      "The map from a force and a moment about the points' middle, in the axes of a contact, to "
      "the forces of least norm at the points that have this sum.";
  FrameMotion<In> frame;
  In<'k', 3> points;  // in the frame's axes
  In<3> shift;        // of all of them, in world axes
  In<3, 3> axes;      // of the contact, as columns
  Out<'f', 6> out;    // three rows for each point
  Scratch<'k', 3> arms;
  Scratch<6, 'f'> total;
  Scratch<6, 6> turned;

  void check() const {
    check_at_least("points", points.rows(), 1);
    check_at_least("the rows of out", out.rows(), 3 * points.rows());
  }
  void operator()() {
    constexpr double negligible = 1e-9;  // relative to the largest singular value
    for (Index k = 0; k < points.rows(); ++k)
      arms.row(k) = (frame.rotation * points.row(k).transpose() + shift).transpose();
    const Vector3 middle = arms.colwise().mean().transpose();
    total.setZero();
    for (Index k = 0; k < points.rows(); ++k) {
      const Vector3 arm = axes.transpose() * (arms.row(k).transpose() - middle);
      total.block<3, 3>(0, 3 * k).setIdentity();
      total.block<3, 3>(3, 3 * k) = skew(arm);
    }
    orthogonalise_rows(total, turned);
    const double largest = std::sqrt(greatest(total.rowwise().squaredNorm()));
    out.setZero();
    for (Index r = 0; r < 6; ++r) {
      const double square = total.row(r).squaredNorm();
      if (std::sqrt(square) <= negligible * largest) continue;
      turned.row(r) /= square;
      out += total.row(r).transpose().lazyProduct(turned.row(r));
    }
  }
};

struct SlidingFriction {
  static constexpr const char* doc =
      "The tangential force of a point that slides, f_t = -μ f_n tanh(‖u‖/u_s) u/‖u‖, with u its "
      "velocity once all errors are zero: that of v + e_N + J# e'.";
  // Measurement noise cancels in it, and a hand that sticks is pushed where it is to go.
  FrameMotion<In> frame;
  In<3> point, shift;  // in the frame's axes; from there, in world axes
  In<3, 3> axes;       // two tangents and the normal, as columns
  In<'n'> v, null_space_error;
  In<'n', 'n'> L;  // of the metric
  In<'m', 'n'> jacobian;
  In<'m'> error_rate;
  double friction, smoothing;  // μ; u_s [m/s]
  InOut<3> reference;          // f, whose normal force is given [N]
  Scratch<'m', 'n'> rows;
  Scratch<'m', 'm'> turned;
  Scratch<'n'> intended;

  void operator()() {
    constexpr double negligible = 1e-6;  // relative to the largest singular value
    rows = jacobian;
    solve_rows(L, rows);
    orthogonalise_rows(rows, turned);
    const double largest = std::sqrt(greatest(rows.rowwise().squaredNorm()));
    intended.setZero();
    for (Index r = 0; r < rows.rows(); ++r) {
      const double square = rows.row(r).squaredNorm();
      if (std::sqrt(square) > negligible * largest)
        intended += turned.row(r).dot(error_rate) / square * rows.row(r).transpose();
    }
    solve_lower_transposed(L, intended);
    intended += v + null_space_error;
    const Vector6 twist = frame.jacobian.lazyProduct(intended);
    const Vector3 arm = frame.rotation * point + shift;
    const Vector3 slip = axes.transpose() * (twist.head<3>() + twist.tail<3>().cross(arm));
    const double speed = std::hypot(slip[0], slip[1]);
    if (speed > 0.0)
      reference.head<2>() =
          -friction * std::tanh(speed / smoothing) / speed * reference[2] * slip.head<2>();
  }
};

struct WithinCones {
  static constexpr const char* doc =
      "Whether forces are within friction cones, cone f ≥ 0, and lower ≤ f ≤ upper.";
  In<'c', 'f'> cone;  // four rows for each point, which has three forces
  In<'f'> forces, lower, upper;

  void check() const { check_at_least("the rows of cone", cone.rows(), forces.size() / 3 * 4); }
  bool operator()() {
    bool inside =
        (lower.array() <= forces.array()).all() && (forces.array() <= upper.array()).all();
    for (Index point = 0; point < forces.size() / 3; ++point) {
      const auto f = forces.segment<3>(3 * point);
      inside &= ((cone.block<4, 3>(4 * point, 3 * point) * f).array() >= 0.0).all();
    }
    return inside;
  }
};

}  // namespace hsp
