// An input that changes like the time line of a controller in Python: see `Evolution`.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/indices.hpp>
#include <hsp/kind.hpp>
#include <hsp/linalg.hpp>
#include <limits>

#include "../trajectories/smooth_step.hpp"

namespace hsp {

struct Evolve {
  static constexpr const char* doc =
      "x(t): each transition k crossfades from the value before, x_(k-1)(t) + s_k (target_k - "
      "x_(k-1)(t)).";
  InOut<'n'> initial;       // x before all transitions that are kept
  InOut<'k', 'n'> targets;  // in order of time
  InOut<'k', 2> times;      // start and duration of each [s]
  InOutInts<1> count;       // how many there are
  double least, most;       // bounds of commands
  In<'h', 'n'> cone;        // rows a with a·x ≥ 0, but for rounding
  std::int64_t definite;    // size of x as a matrix that has to be positive definite; 0: it is none
  Out<'n'> x, rate;         // x' of the ramps [1/s]
  InOut<1> ramp;            // of the last transition that has begun [s]
  Scratch<'n'> factor;      // of such a matrix

  void check() const {
    if (definite < 0 || (definite != 0 && definite * definite != x.size()))
      throw std::invalid_argument("definite is 0, or the size of a matrix of as many numbers as x");
  }

  void operator()(double t) {
    x = initial;
    rate.setZero();
    for (Index k = 0; k < used(); ++k) {
      const double start = times(k, 0);
      if (start > t) break;
      ramp[0] = times(k, 1);
      const SmoothStep step =
          ramp[0] == 0.0 ? SmoothStep{1.0, 0.0, 0.0} : smooth_step(t, start, ramp[0]);
      const auto target = targets.row(k).transpose();
      if (step.over()) {
        x = target;
        rate.setZero();
      } else if (step.s > 0.0) {
        rate = (1.0 - step.s) * rate + step.s_dot * (target - x);
        x += step.s * (target - x);
      }
    }
  }

  // Whether x may become this.
  template <class Values> bool permits(const Values& wanted) {
    if (!wanted.allFinite() || (wanted.array() < least).any() || (wanted.array() > most).any())
      return false;
    const double rounding = 1e-9 * (1.0 + greatest(wanted.cwiseAbs()));
    for (Index k = 0; k < cone.rows(); ++k)
      if (cone.row(k).dot(wanted) < -rounding) return false;
    if (definite == 0) return true;
    Eigen::Map<Matrix> L(factor.data(), definite, definite);
    const Eigen::Map<const Matrix> given(wanted.data(), definite, definite);
    L = 0.5 * (given + given.transpose());
    return cholesky(L, L);
  }

  // x after all transitions.
  auto last() const {
    return Eigen::Map<const Vector>(
        used() == 0 ? initial.data() : targets.data() + (used() - 1) * targets.cols(), x.size());
  }

  // Go to a value from a time on, which is none before the last one; whether there is room for it.
  template <class Values> bool then(double t, double duration, const Values& wanted) {
    settle(t);
    if (used() == targets.rows()) return false;
    targets.row(used()) = wanted.transpose();
    times.row(used()) << t, duration;
    ++count[0];
    return true;
  }

 private:
  Index used() const { return std::clamp<Index>(count[0], 0, targets.rows()); }

  // Drop completed transitions: x is the target of the last of them.
  void settle(double t) {
    Index done = 0;
    for (Index k = 0; k < used(); ++k)
      if (times(k, 0) + times(k, 1) <= t) done = k + 1;
    if (done == 0) return;
    initial = targets.row(done - 1).transpose();
    for (Index k = done; k < used(); ++k) {
      targets.row(k - done) = targets.row(k);
      times.row(k - done) = times.row(k);
    }
    count[0] -= done;
  }
};

struct ScaledIdentity {
  static constexpr const char* doc = "out = k I.";
  In<1> k;
  Out<'n', 'n'> out;

  void operator()() {
    out.setZero();
    out.diagonal().setConstant(k[0]);
  }
};

}  // namespace hsp
