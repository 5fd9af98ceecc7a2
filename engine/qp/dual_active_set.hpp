// A dual active-set solver for small, dense, strictly convex QPs.
//
// Minimise ½ ‖y‖² over x = x0 + J y, where H⁻¹ = J Jᵀ, subject to
//
//   lower ≤ A x ≤ upper,        the first rows equalities,
//   least ≤ x ≤ greatest,       entries may be infinite.
//
// The method is that of Goldfarb and Idnani (1983). It starts at the unconstrained optimum and
// adds the most violated constraint, until none is violated. The active constraints are stored as
// B = L Q: row i of B is b_i = Jᵀ a_i, Q has orthonormal rows and L is lower triangular (Gill,
// Gould, Murray, Saunders and Wright 1984, "A weighted Gram-Schmidt method for convex quadratic
// programming"). So J is never changed, and its zeros and those of A's rows save work in every
// iteration.
//
// Each constraint that enters raises the dual cost strictly, so no set of active constraints
// returns and the method cannot cycle; against rounding there is a limit on iterations.
//
// A constraint can be *soft*: lower ≤ a·x + s ≤ upper with the cost s²/(2 σ²). Its slack s is one
// more entry of y, and σ one more entry of Jᵀ a: it has a column only while the constraint is
// active, so that constraints that are not violated cost no time. A QP whose constraints contradict
// each other is solved again with soft ones: the smaller σ, the nearer to the least violation. σ of
// 1e-2 times the dearest motion's entries of J is safe; at 1e-4 rounding shows where the cheapest
// motion is 1e4 times cheaper.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/indices.hpp>
#include <hsp/kind.hpp>
#include <hsp/linalg.hpp>
#include <limits>
#include <stdexcept>

namespace hsp {

// A QP with k rows lower ≤ A x ≤ upper; bounds on x count as k, k + 1, ...
//
// The cost couples the first unknowns; the others' costs are separate: J is
// block-diagonal.
struct QP {
  In<'z', 'f'> JT;  // Jᵀ of the first unknowns; directions outside the span of its rows do not move
  In<'o'> own;      // J of the others, 1/√cost of each
  In<'k', 'n'> A;
  Ints<'k'> begin, end;     // of the non-zero entries of each row of A
  In<'c'> lower, upper;     // of the rows and then of x: c = k + n
  In<'s'> softness;         // σ of each constraint, zero if it is hard; none if all are
  std::int64_t equalities;  // number of leading rows that are equalities, lower = upper

  void check() const {
    for (Index r = 0; r < begin.size(); ++r) check_range("a row of A", begin[r], end[r], A.cols());
  }
};

// The active constraints, from which the next QP begins after a warm start.
struct ActiveSet {
  InOutInts<'c'> held;     // 1 if a constraint's lower bound is active, -1 if the upper, else 0
  InOutInts<2> counts;     // of active constraints and of iterations
  InOutInts<'m'> active;   // their indices
  InOut<'m'> multipliers;  // H (x - x0) = Σ multiplier a; positive at lower bounds
};

// Memory of the solver; m is the maximum number of active constraints.
struct ActiveSetMemory {
  Vector x0, y;
  double rounding = 0.0;  // square of a remainder of Jᵀ a that is rounding, for ‖a‖ = 1
  Matrix B;               // Jᵀ a of active constraints, and then that of an entering one
  Matrix L, Q;            // B = L Q
  Vector remainder;       // part of the entering constraint's b outside the span of Q
  Vector components;      // Q b
  Vector again;           // their rounding errors
  Vector lack;            // of the active constraints
  Vector rate;            // of the multipliers
  Index width = 0;        // present number of entries of y
  Eigen::Matrix<Index, Eigen::Dynamic, 1> slack;  // index of the entry of a constraint; -1: none

  void prepare(const Sizes& size) {
    const Index n = size('n'), slacks = size('s'), constraints = size('k') + n;
    const Index width = n + slacks, m = std::min(width, constraints);
    if (size('c') != constraints || size('f') + size('o') != n || size('m') < m ||
        size('z') > size('f') || (slacks != 0 && slacks != constraints))
      throw std::invalid_argument("a QP: the sizes do not fit together, see engine/qp");
    x0.setZero(n);
    y.setZero(width);
    B.setZero(m + 1, width);
    L.setZero(m, m);
    Q.setZero(m, width);
    remainder.setZero(width);
    for (Vector* each : {&components, &again, &lack, &rate}) each->setZero(m);
    slack.setConstant(slacks, -1);
  }
};

// One solution of a QP. J's columns are the first `moving` rows of Jᵀ.
class DualActiveSet {
 public:
  enum Code {
    SOLVED,      // x is the optimum
    INFEASIBLE,  // the constraints contradict each other, or something is NaN
    EXHAUSTED,   // the limit on iterations was reached, or rounding prevents an answer: neither
                 // was seen with hard constraints
  };

  // Limit on iterations, per constraint. Random QPs need 3 at most, Talos with all
  // efforts at their limits 5.
  static constexpr Index most_iterations = 10;

  DualActiveSet(const QP& qp, Index moving, InOut<'n'>& x, ActiveSet& set, ActiveSetMemory& memory)
      : qp(qp),
        moving(std::clamp<Index>(moving, 0, qp.JT.rows())),
        x(x),
        set(set),
        memory(memory) {}

  // Overwrite x0 with the optimum x. A warm start begins with the active constraints of the last
  // solution.
  //
  // Finally the optimum of the active constraints is computed in their order, so that x does not
  // depend on the iterations, not even in its last bit: a step is the same whether it began with
  // the active constraints of the last one or not.
  Code minimise(bool warm, Index iterations_per_constraint = most_iterations) {
    if (!prepare(warm)) return INFEASIBLE;
    return iterate(begin(), iterations_per_constraint);
  }

  // The optimum of the same QP from another x0, which is in x, after one that was found: the active
  // constraints need no factorisation.
  Code minimise_again() {
    const Index held = count();
    memory.x0 = x;
    iterations() = 0;
    settle();
    return iterate(count() == held, most_iterations);
  }

 private:
  // Add violated constraints until there is none; `in_order`: x is the optimum of the active ones.
  Code iterate(bool in_order, Index iterations_per_constraint) {
    bool settled = in_order;
    double tolerance = first_tolerance;
    const Index limit = iterations_per_constraint * set.held.size();
    while (iterations() < limit && tolerance < loosest_tolerance) {
      const Violation worst = most_violated(tolerance);
      if (worst.constraint >= 0) {
        if (settled && iterations() > 0) tolerance *= 10.0;
        if (!enter(worst)) return INFEASIBLE;
        move();
        in_order = settled = false;
      } else if (in_order) {
        return SOLVED;
      } else {  // x is a sum of steps: recompute it, and check again
        in_order = begin();
        settled = true;
      }
    }
    return EXHAUSTED;
  }

  // Distance from x to a violated constraint that is accepted, relative to 1 + max|x|. It does not
  // depend on the scale of the row. It grows tenfold each time that x, computed anew, violates a
  // constraint: where active rows nearly depend on each other, rounding can let two of them take
  // turns. A QP that is not solved with the loosest one is abandoned.
  static constexpr double first_tolerance = 1e-10, loosest_tolerance = 1e-6;

  // A row belongs to the span of the active ones if its remainder in y is smaller than this,
  // relative to ‖a‖ ‖J‖_F: rounding leaves 1e-15, the cheapest and the dearest motion of the law
  // differ by 1e4.
  static constexpr double dependent = 1e-12;

  struct Violation {
    Index constraint = -1;  // none
    double size = 0.0;
  };

  const QP& qp;
  const Index moving;
  InOut<'n'>& x;
  ActiveSet& set;
  ActiveSetMemory& memory;

  std::int64_t& count() { return set.counts[0]; }
  std::int64_t& iterations() { return set.counts[1]; }
  auto JT() const { return qp.JT.topRows(moving); }
  auto y() { return memory.y.head(memory.width); }
  auto B() { return memory.B.topLeftCorner(count(), memory.width); }
  auto L() { return memory.L.topLeftCorner(count(), count()); }
  auto Q() { return memory.Q.topLeftCorner(count(), memory.width); }
  auto remainder() { return memory.remainder.head(memory.width); }
  auto multipliers() { return set.multipliers.head(count()); }
  auto a(Index i) const { return qp.A.row(i).segment(qp.begin[i], qp.end[i] - qp.begin[i]); }

  // Begin at x0 and mark the constraints to hold; return whether each can be met alone. NaN makes
  // each comparison false, and so the result; in A it is found by `most_violated`.
  bool prepare(bool warm) {
    set.counts.setZero();
    memory.x0 = x;
    const double size = 1.0 + x.lpNorm<1>(), squares = qp.own.squaredNorm() + JT().squaredNorm();
    memory.rounding = dependent * dependent * squares;
    bool possible = size + squares < std::numeric_limits<double>::infinity();
    for (Index i = 0; i < set.held.size(); ++i) {
      const double gap = qp.lower[i] - qp.upper[i];
      if (!(gap <= 0.0)) possible &= gap <= first_tolerance * norm(i) * size;
      if (i < qp.equalities) set.held[i] = 1;
      else if (!(warm && std::isfinite(bound(i)))) set.held[i] = 0;
    }
    return possible;
  }

  // Hold the marked constraints, in their order, and make x their optimum. Not all can be held
  // where one depends on others, or has the wrong sign: false.
  bool begin() {
    Index marked = 0;
    count() = 0;
    memory.width = x.size();
    memory.slack.setConstant(-1);
    y().setZero();
    for (Index i = 0; i < set.held.size(); ++i) {
      if (set.held[i] == 0) continue;
      ++marked;
      const double square = project(i);
      if (is_independent(i, square)) extend(i, square);
      else set.held[i] = 0;
    }
    if (marked > 0) settle();
    return count() == marked;
  }

  // Make y and x the optimum of the active constraints, without rounding of steps.
  //
  // w = L⁻¹ (b - A x) is their residual; the multipliers grow by L⁻ᵀ w. Twice, at x0 and at y = Bᵀ
  // multipliers, since the second time corrects the first; then y grows by Qᵀ w. Constraints with a
  // multiplier of the wrong sign are released, the worst first: the method may begin from the
  // remaining ones.
  void settle() {
    for (Index wrong = 0; wrong >= 0;) {
      auto w = memory.lack.head(count());
      y().setZero();  // the slacks, too
      write_lack(memory.x0, w);
      solve_lower_transposed(L(), w);
      multipliers() = w;
      y().noalias() += B().transpose() * w;
      move();
      write_lack(x, w);
      y().noalias() += Q().transpose() * w;
      solve_lower_transposed(L(), w);
      multipliers() += w;
      wrong = worst_sign();
      if (wrong >= 0) release(wrong);
    }
    move();
  }

  // The active inequality whose multiplier is most wrong, or -1.
  Index worst_sign() {
    Index wrong = -1;
    double least = 0.0;
    for (Index c = 0; c < count(); ++c) {
      const Index i = set.active[c];
      const double inwards = set.held[i] * set.multipliers[c];
      if (i >= qp.equalities && inwards < least) {
        wrong = c;
        least = inwards;
      }
    }
    return wrong;
  }

  // w = L⁻¹ (b - A x) of the active constraints.
  template <class X, class W> void write_lack(const X& at, W& w) {
    for (Index c = 0; c < count(); ++c) w[c] = bound(set.active[c]) - value(set.active[c], at);
    solve_lower(L(), w);
  }

  // x = x0 + J y.
  void move() {
    const Index n = qp.JT.cols(), p = qp.own.size();
    x = memory.x0;
    x.head(n).noalias() += JT().transpose() * memory.y.head(moving);
    x.tail(p) += qp.own.cwiseProduct(memory.y.segment(moving, p));
  }

  // The most violated constraint, marked as held, and its violation. The
  // distance is the violation divided by the length of the row. A row that contains NaN is
  // violated.
  Violation most_violated(double tolerance) {
    double farthest = tolerance * (1.0 + x.lpNorm<Eigen::Infinity>());
    Violation worst;
    int side = 0;
    for (Index i = 0; i < set.held.size(); ++i) {
      if (set.held[i] != 0) continue;
      const double at = value(i, x), below = qp.lower[i] - at, above = at - qp.upper[i];
      if (below <= 0.0 && above <= 0.0) continue;
      const double beyond = std::max(below, above), length = norm(i);
      if (!(beyond <= farthest * length)) {
        farthest = beyond / length;
        worst = {i, beyond};
        side = below > above ? 1 : -1;
      }
    }
    if (worst.constraint >= 0) set.held[worst.constraint] = side;
    return worst;
  }

  // Make a violated constraint active; false if that is impossible.
  //
  // Steps 2 and 3 of the method. Its multiplier grows from zero and y moves with it, until the
  // constraint holds. An active one whose multiplier vanishes first is released.
  bool enter(Violation entering) {
    const Index i = entering.constraint;
    const double side = static_cast<double>(set.held[i]);
    double square = project(i), multiplier = 0.0;
    while (true) {
      ++iterations();
      const bool independent = is_independent(i, square);
      auto rate = memory.rate.head(count());  // Lᵀ rate = Q b
      rate = memory.components.head(count());
      solve_lower_transposed(L(), rate);
      double step = independent ? entering.size / square : std::numeric_limits<double>::infinity();
      const Index leaving = first_to_vanish(side, step);
      if (!(step < std::numeric_limits<double>::infinity())) {
        set.held[i] = 0;  // a warm start begins with those that contradict it
        return false;
      }
      multiplier += side * step;
      multipliers() -= side * step * rate;
      if (independent) {
        entering.size -= step * square;
        y() += side * step * remainder();
      }
      if (leaving < 0) {
        extend(i, square);
        set.multipliers[count() - 1] = multiplier;
        return true;
      }
      release(leaving);  // the remainder gains the released direction
      const auto freed = memory.Q.row(count()).head(memory.width);
      remainder() += memory.components[count()] * freed.transpose();
      square = remainder().squaredNorm();
    }
  }

  // Shorten a step to where the first multiplier of an active inequality vanishes; return its
  // index, or -1.
  Index first_to_vanish(double side, double& step) {
    Index leaving = -1;
    for (Index c = 0; c < count(); ++c) {
      const Index i = set.active[c];
      const double sign = static_cast<double>(set.held[i]), decrease = side * sign * memory.rate[c];
      if (i < qp.equalities || !(decrease > 0.0)) continue;
      const double limit = sign * set.multipliers[c] / decrease;
      if (limit < step) {
        step = limit;
        leaving = c;
      }
    }
    return leaving;
  }

  // Write b = Jᵀ a of constraint i, Q b, and the remainder of b; return its square.
  //
  // b goes to the row of B after the active ones. If nine tenths of the length cancel, the
  // components are subtracted a second time ("twice is enough", Giraud et al. 2005).
  double project(Index i) {
    if (is_soft(i) && memory.slack[i] < 0) add_slack(i);
    auto remainder = this->remainder();
    auto components = memory.components.head(count()), again = memory.again.head(count());
    auto b = memory.B.row(count()).head(memory.width);
    write_row(i, b);
    remainder = b.transpose();
    const double before = remainder.squaredNorm();
    components.noalias() = Q() * remainder;
    remainder.noalias() -= Q().transpose() * components;
    const double after = remainder.squaredNorm();
    if (count() == 0 || after > 0.01 * before) return after;
    again.noalias() = Q() * remainder;
    components += again;
    remainder.noalias() -= Q().transpose() * again;
    return remainder.squaredNorm();
  }

  // b = Jᵀ a of constraint i, and its softness.
  template <class Row> void write_row(Index i, Row& b) {
    const Index n = qp.JT.cols(), p = qp.own.size(), k = qp.A.rows();
    auto first = b.head(moving);
    auto own = b.segment(moving, p);
    b.setZero();
    if (i >= k + n) {
      own[i - k - n] = qp.own[i - k - n];
    } else if (i >= k) {
      first = JT().col(i - k).transpose();
    } else {
      const auto row = qp.A.row(i);
      const Index from = qp.begin[i], to = qp.end[i], middle = std::min(n, to);
      if (from < n)
        first = row.segment(from, middle - from)
                    .lazyProduct(JT().middleCols(from, middle - from).transpose());
      const Index alone = std::max(n, from);
      if (alone < to)
        own.segment(alone - n, to - alone) =
            row.segment(alone, to - alone)
                .cwiseProduct(qp.own.segment(alone - n, to - alone).transpose());
    }
    if (is_soft(i)) b[memory.slack[i]] = qp.softness[i];
  }

  bool is_soft(Index i) const { return qp.softness.size() > 0 && qp.softness[i] > 0.0; }

  // One more entry of y: the slack of constraint i.
  void add_slack(Index i) {
    const Index column = memory.width++;
    memory.slack[i] = column;
    memory.y[column] = 0.0;
    memory.B.col(column).head(count()).setZero();
    memory.Q.col(column).head(count()).setZero();
  }

  // Add constraint i to the active ones: one more row of L and of Q. Its row of B is there already.
  void extend(Index i, double square) {
    const Index c = count();
    const double size = std::sqrt(square);
    memory.L.row(c).head(c) = memory.components.head(c).transpose();
    memory.L(c, c) = size;
    memory.Q.row(c).head(memory.width) = remainder().transpose() / size;
    set.active[c] = i;
    set.multipliers[c] = 0.0;
    count() = c + 1;
  }

  // Remove an active constraint: rotations make L lower triangular again. They leave the released
  // direction in the row of Q after the last, and rotate the components Q b, too.
  void release(Index leaving) {
    auto& [x0, y, rounding, B, L, Q, remainder, components, again, lack, rate, width, slack] =
        memory;
    set.held[set.active[leaving]] = 0;
    const Index last = --count();
    for (Index r = leaving; r <= last; ++r) B.row(r) = B.row(r + 1);  // the entering one's, too
    for (Index r = leaving; r < last; ++r) {
      set.active[r] = set.active[r + 1];
      set.multipliers[r] = set.multipliers[r + 1];
      L.row(r).head(r + 2) = L.row(r + 1).head(r + 2);
    }
    for (Index r = leaving; r < last; ++r) {
      Eigen::JacobiRotation<double> rotation;
      rotation.makeGivens(L(r, r), L(r, r + 1));
      L.middleRows(r, last - r).applyOnTheRight(r, r + 1, rotation);
      Q.applyOnTheLeft(r, r + 1, rotation.adjoint());
      components.applyOnTheLeft(r, r + 1, rotation.adjoint());
    }
  }

  double bound(Index i) const { return set.held[i] > 0 ? qp.lower[i] : qp.upper[i]; }

  // a_i·x, and the slack if constraint i is soft.
  template <class X> double value(Index i, const X& at) const {
    const Index k = qp.A.rows();
    const double hard =
        i >= k ? at[i - k] : a(i).dot(at.segment(qp.begin[i], qp.end[i] - qp.begin[i]));
    if (qp.softness.size() == 0 || memory.slack[i] < 0) return hard;
    return hard + qp.softness[i] * memory.y[memory.slack[i]];
  }

  // ‖a‖ of constraint i, and 1 for a row of zeros.
  double norm(Index i) const {
    const double square = i < qp.A.rows() ? a(i).squaredNorm() : 1.0;
    return square != 0.0 ? std::sqrt(square) : 1.0;
  }

  // Whether constraint i is not in the span of the active ones, by the square of its remainder:
  // where they span all that y can move in, what remains is rounding, however large it is.
  bool is_independent(Index i, double square) const {
    const Index slacks = memory.width - x.size();
    return set.counts[0] < moving + qp.own.size() + slacks && square > negligible(i);
  }

  // The square of a remainder of Jᵀ a that is rounding.
  double negligible(Index i) const { return memory.rounding * norm(i) * norm(i); }
};

struct Minimise {
  static constexpr const char* doc = "The optimum of a QP; 0: solved, 1: infeasible, 2: exhausted.";
  QP problem;
  std::int64_t iterations;  // limit, per constraint
  bool warm;                // begin with the active constraints
  InOut<'n'> x;             // x0, then the optimum
  ActiveSet work;
  ActiveSetMemory memory;

  int operator()() {
    DualActiveSet solver(problem, problem.JT.rows(), x, work, memory);
    return solver.minimise(warm, iterations);
  }
};

}  // namespace hsp
