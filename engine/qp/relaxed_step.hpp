// A step whose limits contradict each other: some rows are widened as little as possible.
//
// Soft are the accelerations of contacts, the bounds on the joints' motion and the rows of
// barriers; efforts, cones and forces stay within their limits. First the least violation is found,
// then the rows are widened by it, and the step is the nearest to the law's command within them
// (`limited_step.hpp`).
#pragma once
#include <algorithm>
#include <limits>

#include "limited_step.hpp"

namespace hsp {

// Bounds of the rows, with those of contacts, and of x.
struct RelaxedRows {
  static constexpr const char* doc =
      "Copy the bounds of the QP, with J δ = 0 of the contacts as rows.";
  In<'c'> lower, upper;
  Ints<'k'> end;
  In<'h', 'v'> J;      // of the contacts
  std::int64_t first;  // row of theirs
  InOut<'k', 'x'> A;
  Out<'c'> relaxed_lower, relaxed_upper;
  OutInts<'k'> relaxed_end;

  void check() const {
    check_range("rows of contacts", first, first + J.rows(), A.rows());
    check_at_least("the columns of A", A.cols(), J.cols());
    if (lower.size() != A.rows() + A.cols())
      throw std::invalid_argument("lower and upper must be those of the rows and of x");
  }
  void operator()() {
    const Index h = J.rows(), n = J.cols();
    relaxed_lower = lower;
    relaxed_upper = upper;
    relaxed_end = end;
    A.middleRows(first, h).leftCols(n) = J;
    relaxed_lower.segment(first, h).setZero();
    relaxed_upper.segment(first, h).setZero();
    relaxed_end.segment(first, h).setConstant(n);
  }
};

struct LeastViolation {
  static constexpr const char* doc =
      "The x that violates soft rows least, without any cost of x itself.";
  std::int64_t reached;  // the status of a step with it
  QP problem;
  InOut<'n'> x;
  ActiveSet work;
  QPOutcome<OutInts> outcome;
  ActiveSetMemory memory;
  Scratch<'n'> last;

  // Each round penalises the difference from the result of the round before, so that the cost of x
  // fades, whatever its size. Otherwise 1e3 rad/s², which a far target requires, would outweigh a
  // violation.
  void operator()() {
    x.setZero();
    last.setZero();
    outcome.unsolved[0] = 1;
    outcome.status[0] = reached;
    DualActiveSet solver(problem, problem.JT.rows(), x, work, memory);
    for (int round = 0; round < most_rounds; ++round) {
      const auto code = round == 0 ? solver.minimise(true) : solver.minimise_again();
      const bool solved = code == DualActiveSet::SOLVED && x.allFinite();
      if (!solved) {
        x = last;
        return;
      }
      outcome.unsolved[0] = 0;
      const double change = (x - last).lpNorm<Eigen::Infinity>();
      if (change <= settled * (1.0 + x.lpNorm<Eigen::Infinity>())) return;
      last = x;
    }
  }

 private:
  static constexpr int most_rounds = 4;
  static constexpr double settled = 1e-13;  // change of x between rounds that is rounding
};

struct Widen {
  static constexpr const char* doc = "Widen the soft rows to contain x; write the violation.";
  Ints<1> unsolved;  // whether there is no x
  In<'k', 'n'> A;
  In<'n'> x;
  In<'c'> softness;  // 0 of hard rows
  InOut<'c'> lower, upper;
  Out<1> relaxation;  // the largest violation

  void check() const {
    if (softness.size() != A.rows() + A.cols())
      throw std::invalid_argument("softness must be that of the rows and of x");
  }
  void operator()() {
    relaxation[0] = 0.0;
    if (unsolved[0]) {
      relaxation[0] = std::numeric_limits<double>::infinity();
      return;
    }
    for (Index i = 0; i < softness.size(); ++i) {
      if (softness[i] == 0.0) continue;
      const double reached = i < A.rows() ? A.row(i).dot(x) : x[i - A.rows()];
      const double slack = rounding * (1.0 + std::abs(reached));
      relaxation[0] = std::max({relaxation[0], lower[i] - reached, reached - upper[i]});
      lower[i] = std::min(lower[i], reached - slack);
      upper[i] = std::max(upper[i], reached + slack);
    }
  }

 private:
  static constexpr double rounding = 1e-7;  // room for the step that is solved within the rows
};

}  // namespace hsp
