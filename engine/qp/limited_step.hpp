// The QP of a step within limits: its rows, its start, its solution.
//
// The unknowns are x = (δ, g): δ the deviation from the law's acceleration, and g the contact
// forces in robot weights. The first rows are
//
//   base        (M a + N - F f)_base = 0                          no motor acts there
//   effort      bounds on M a + N - F f, within the rate limit of the last effort
//
// and then those of cones (Python's), barriers (`PlaceRows`) and contacts (`RelaxedRows`). The
// bounds of x are those on a from position, velocity and acceleration limits, and those of f.
#pragma once
#include <cmath>

#include "../edge/excess.hpp"
#include "../limits/records.hpp"
#include "dual_active_set.hpp"

namespace hsp {

// The possible contact forces; none if they are empty.
struct Forces {
  In<'n', 'p'> map;  // F
  In<'p'> first;     // forces nearest to the commanded ones
  In<'p'> lower, upper;
  In<'p'> inverse_cost;  // e: the cost is Σ (f - f_ref)²/e
  double weight;         // robot's weight
};

// Degrees of freedom of the first rows: those without a motor, of which there are `base`, then
// those with a limit on their effort.
struct Places {
  Ints<'d'> dofs;
  std::int64_t base;

  void check() const { check_index("places.base", base, dofs.size() + 1); }
  void check_dofs(Index n) const { check_indices("places.dofs", dofs, n); }
};

// Throws unless x is one deviation and the forces.
inline void check_step(Index x, const Wanted<In>& wanted, const Forces& forces) {
  if (x != wanted.effort.size() + forces.first.size())
    throw std::invalid_argument("x must be n deviations and the forces");
}

// The delivered quantities.
struct Result {
  InOut<'n'> effort, acceleration;
  InOut<'p'> forces;
};

struct BeginLimitedStep {
  static constexpr const char* doc =
      "No deviation, with forces of minimum norm; and the forces' part of J.";
  Forces forces;
  double cost;  // of squared forces
  Out<'p'> own;
  Out<'x'> x;

  void check() const { check_at_least("x", x.size(), own.size()); }
  void operator()() {
    // While a contact fades the cost of its forces grows, but stays finite.
    constexpr double least_inverse_cost = 1e-6;
    const Index p = own.size();
    own = (forces.inverse_cost.array().max(least_inverse_cost) / cost).sqrt();
    x.head(x.size() - p).setZero();
    x.tail(p) = forces.first / forces.weight;
  }
};

struct LimitedRows {
  static constexpr const char* doc = "The rows of base and efforts, and the bounds of x.";
  Wanted<In> wanted;
  Forces forces;
  Bounds<In> bounds;
  Places places;
  InOut<'k', 'x'> A;
  InOut<'c'> lower, upper;

  void check() const {
    places.check_dofs(wanted.effort.size());
    check_at_least("A", A.rows(), places.dofs.size());
    check_step(A.cols(), wanted, forces);
    if (lower.size() != A.rows() + A.cols())
      throw std::invalid_argument("lower and upper must be those of the rows and of x");
  }
  void operator()() {
    const auto& [M, a, effort] = wanted;
    const Index n = a.size(), p = forces.first.size(), k = A.rows();
    for (Index r = 0; r < places.dofs.size(); ++r) {
      const Index i = places.dofs[r];
      const bool has_motor = r >= places.base;
      A.row(r).head(n) = M.col(i).transpose();  // M is symmetric
      A.row(r).tail(p) = -forces.weight * forces.map.row(i);
      lower[r] = (has_motor ? bounds.tau_lower[i] : 0.0) - effort[i];
      upper[r] = (has_motor ? bounds.tau_upper[i] : 0.0) - effort[i];
    }
    lower.segment(k, n) = bounds.a_lower - a;
    upper.segment(k, n) = bounds.a_upper - a;
    lower.tail(p) = forces.lower / forces.weight;
    upper.tail(p) = forces.upper / forces.weight;
  }
};

struct SolveLimitedStep {
  static constexpr const char* doc = "The optimum of the QP, and its status.";
  std::int64_t reached;  // the status of its solution
  bool warm;
  QP problem;
  Ints<1> moving;  // number of rows of Jᵀ that move
  InOut<'n'> x;
  ActiveSet work;
  QPOutcome<OutInts> outcome;
  ActiveSetMemory memory;

  void operator()() {
    DualActiveSet solver(problem, moving[0], x, work, memory);
    outcome.unsolved[0] = solver.minimise(warm) != DualActiveSet::SOLVED;
    outcome.status[0] = reached;
  }
};

struct LimitedResult {
  static constexpr const char* doc =
      "Effort, acceleration and forces of x, without the solver's violations.";
  Wanted<In> wanted;
  Forces forces;
  Bounds<In> bounds;
  Places places;
  In<'x'> x;
  Result result;
  InOutInts<1> unsolved;  // also where the effort is not finite

  void check() const {
    places.check_dofs(wanted.effort.size());
    check_step(x.size(), wanted, forces);
  }
  void operator()() {
    if (!unsolved[0]) unsolved[0] = !write();
  }

 private:
  bool write() {
    const Index n = wanted.acceleration.size(), p = forces.first.size();
    auto& [effort, acceleration, f] = result;
    const auto deviation = x.head(n);
    f = (forces.weight * x.tail(p)).cwiseMax(forces.lower).cwiseMin(forces.upper);
    acceleration = wanted.acceleration + deviation;
    effort = wanted.effort;
    effort.noalias() += wanted.mass_matrix * deviation;
    effort.noalias() -= forces.map * f;
    const bool finite = effort.allFinite();
    effort = effort.cwiseMax(bounds.tau_lower).cwiseMin(bounds.tau_upper);
    for (Index r = 0; r < places.base; ++r) effort[places.dofs[r]] = 0.0;
    return finite;
  }
};

}  // namespace hsp
