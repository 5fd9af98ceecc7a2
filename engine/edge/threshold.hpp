// Where an inverse begins to be bounded: a threshold that follows the errors.
//
// A level commands J a = d. Along a direction of the singular value s it gets d/s where s is above
// the threshold ε, and s (2 - s²/ε²) d/ε² below. The steepest of both is 2 d/ε², at s = 0. Let
// f = Kp s(e) be what the feedback commands at rest, the part of d that persists while a task
// cannot be met. With
//
//   ε² = max(ε_0², ‖f‖/L)
//
// the acceleration that it causes changes by at most 2 L for each unit of s, whatever the target.
// docs/edge.md has the propositions, and the origin of each constant.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/records.hpp>

namespace hsp {

// How the thresholds follow what is commanded, and when the exact law applies beside; the constants
// and their reasons are those of `hsp_control/edge/constants.py`.
struct Following {
  double size;      // the robot's [m]; 0: they do not follow
  double steepest;  // L [rad/s² for each unit of a singular value]; inf: it does not follow
  double modest;    // f_0 [m/s² or rad/s²]; 0 on a fixed base
  double below;     // by how much L is less below a held level
  double turning;   // ε for each rad/s of a field where a spring slips [s], times the size
  double quickest;  // the largest part of a field that is used [rad/s]
  double near;      // σ_x: the exact law applies wholly above [m]
  double far;       // part of the largest error up to which it applies wholly
};

// Where the inverses of the levels begin to be bounded.
struct Thresholds {
  InOut<'l'> own;      // ε of each level
  InOut<'l'> follows;  // the part of it that follows f
  InOut<'l'> scales;   // by how much J L⁻ᵀ is longer than J, at least 1: the unit of ε
};

// What is commanded for the rows of the stack, level after level.
struct Demand {
  Ints<'l'> ends;      // where each level's rows end
  In<'m'> demand;      // f, what the feedback commands at rest
  In<'m'> yields;      // by how much L is less for a row; 0: it is not active
  In<'m'> pulls;       // with how much of its largest force a spring pulls
  Flags<'m'> springs;  // whether a row is that of a spring
  In<'m'> stretched;   // how long an error is, relative to its largest length

  void check() const { check_ends("ends", ends, demand.size()); }
};

// The ε that a field needs where a spring slips.
template <class G> double turning_threshold(const G& g, const Following& following) {
  return following.turning * std::min(g.norm(), following.quickest);
}

// Write the threshold of each level, B = J L⁻ᵀ; return a singular value of the stack from which on
// no level is bounded.
template <class J, class B>
double write_thresholds(const J& jacobian, const B& whitened, const Demand& rows, double least,
                        double turning, const Following& following, Thresholds& thresholds) {
  double largest = least, above = 0.0;  // the largest scale of those above
  Index start = 0;
  for (Index level = 0; level < rows.ends.size(); ++level) {
    const Index size = rows.ends[level] - start;
    const auto demand = rows.demand.segment(start, size).array();
    const auto yields = rows.yields.segment(start, size).array();
    const bool sprung = rows.springs.segment(start, size).all();
    const bool tracks = (yields > 0.0).any();
    const double square = (yields > 0.0).select(demand.square(), 0.0).sum();
    const double more = (yields > 0.0).select((yields - 1.0) * demand.square(), 0.0).sum();
    const double pull = rows.pulls.segment(start, size).norm();
    const double plain = jacobian.middleRows(start, size).squaredNorm();
    const double longer = whitened.middleRows(start, size).squaredNorm();
    const double scale = plain > 0.0 ? std::sqrt(std::max(longer / plain, 1.0)) : 1.0;

    double beyond = std::max(std::sqrt(square) - following.modest, 0.0);
    if (beyond > 0.0) beyond *= 1.0 + more / square;
    const double follows = scale * std::sqrt(beyond / following.steepest);
    const double own = std::max({least, follows, scale * std::min(pull, 1.0) * turning});
    largest = std::max(largest, own);
    // No s is below that of the stack: `threshold_below` is not above it then.
    if (above > 0.0)
      largest = std::max(largest, std::cbrt(follows * follows * following.size * above));
    thresholds.own[level] = own;
    thresholds.follows[level] = follows;
    thresholds.scales[level] = scale;
    if (sprung || tracks) above = std::max(above, scale);
    start = rows.ends[level];
  }
  return largest;
}

// The ε that a level below others has at least. It commands f - J a_f; `held` is how much
// those above are held, and `above` their least singular value in their scale, inf if none turns.
template <class F>
double threshold_below(const F& demand, double held, double above, Index level,
                       const Following& following, const Thresholds& thresholds) {
  const double beyond = std::max(demand.norm() - following.modest, 0.0);
  const double scale = thresholds.scales[level], follows = thresholds.follows[level];
  const double square = scale * scale * held * following.below * beyond / following.steepest;
  return std::sqrt(square + follows * follows * following.size / above);
}

// How much a level is held at the edge, from 0 (exact) to nearly 1, by ‖f - J a_f‖², its unmet
// command at rest, and ‖f‖². It grows slowly with the command that its threshold follows: as fast
// as the level is lost to what is below it, both would oscillate.
inline double how_held(double lacking, double wanted, double least, const Following& following) {
  const double beyond = std::sqrt(wanted) - following.modest;
  if (beyond <= 0.0) return 0.0;
  const double lacks = std::min(std::sqrt(lacking / wanted), 1.0);
  return lacks * beyond / (beyond + following.steepest * least * least + following.modest);
}

}  // namespace hsp
