// The damped law of several levels: each inverse is bounded by its threshold.
#pragma once
#include "../law/hierarchy.hpp"
#include "threshold.hpp"

namespace hsp {

struct DampedMemory {
  Scratch<'n'> drawn;  // a_f, the command of the levels above at rest
  Scratch<'m'> rest, opposed, x, row;
  Scratch<'m', 'm'> G, V;
  void prepare(const Sizes& size) {
    drawn.prepare(size);
    for (auto* each : {&rest, &opposed, &x, &row}) each->prepare(size);
    for (auto* each : {&G, &V}) each->prepare(size);
  }
};

// Write e_N and a; return the first level with a damped singular value, 1 for the highest one, and
// 0 if none was damped. The thresholds are raised below levels whose directions turn or that are
// unmet. `by_tasks` is the levels' part of a; the rest is φ_N.
template <class B, class E, class A>
int write_damped_levels(const LawInput& in, const Demand& rows, double least,
                        const Following& following, Thresholds& thresholds,
                        Projectors<InOut>& projectors, DampedMemory& memory, LevelMemory& levels,
                        B& by_tasks, E& e_N, A& a) {
  const auto& [J, J_dot, error, error_rate, a_x] = in.task;
  auto& [drawn, all_rest, all_opposed, all_x, all_row, all_G, all_V] = memory;
  invert_metric(in.metric.L, projectors.Q);
  a.setZero();
  drawn.setZero();
  int damped = 0;
  Index start = 0;
  double held = 0.0, above = std::numeric_limits<double>::infinity();
  for (Index level = 0; level < rows.ends.size(); ++level) {
    const Index size = rows.ends[level] - start;
    const auto J_k = J.middleRows(start, size), J_dot_k = J_dot.middleRows(start, size);
    const auto demand = rows.demand.segment(start, size);
    const auto springs = rows.springs.segment(start, size);
    auto QJ = projectors.QJ.middleCols(start, size);
    auto G_inverse = projectors.G_inverse.block(start, start, size, size);
    auto rest = all_rest.head(size), opposed = all_opposed.head(size);
    auto x = all_x.head(size), row = all_row.head(size);
    auto G = all_G.topLeftCorner(size, size), V = all_V.topLeftCorner(size, size);

    // The residual of the level, and its part at rest, f - J a_f
    rest = a_x.segment(start, size);
    rest.noalias() -= J_dot_k * in.v;
    rest.noalias() -= J_k * a;
    opposed = demand;
    opposed.noalias() -= J_k * drawn;
    const double threshold = std::max(
        thresholds.own[level], threshold_below(opposed, held, above, level, following, thresholds));

    // Its contribution in the null space of the levels above
    const auto units = thresholds.units.segment(start, size);
    const double smallest = open_level(J_k, projectors.Q, units, QJ, G, V, x);
    write_bounded_inverse(V, x, threshold, units, G_inverse);
    add_level(QJ, G_inverse, rest, row, a);
    add_level(QJ, G_inverse, opposed, row, drawn);

    // The projector for the levels below, and how much it turns or is unmet; contacts do neither
    thresholds.own[level] = threshold;
    if (springs.any() || (rows.yields.segment(start, size).array() > 0.0).any())
      above = std::min(above, std::max(std::sqrt(smallest), threshold));
    if (smallest < threshold * threshold) {
      opposed = demand;
      opposed.noalias() -= J_k * drawn;
      const double wanted = springs.select(0.0, demand).squaredNorm();
      const double lacking = springs.select(0.0, opposed).squaredNorm();
      held = std::max(held, how_held(lacking, wanted, least, following));
      if (damped == 0) damped = static_cast<int>(level) + 1;
    }
    close_level(projectors.Q, QJ, G_inverse, row);
    start = rows.ends[level];
  }
  by_tasks = a;
  add_null_space(in, rows.ends, projectors, levels, e_N, a);
  return damped;
}

}  // namespace hsp
