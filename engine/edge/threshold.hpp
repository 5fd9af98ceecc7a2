// Where an inverse begins to be bounded: a threshold that follows the errors.
//
// A level commands J a = d. Along a direction of the singular value s the acceleration is d/s where
// s is above the threshold ε, and s (2 - s²/ε²) d/ε² below. The largest slope of both in s is 2
// d/ε², at s = 0. Let f = Kp s(e) be the feedback's command at rest, the part of d that persists
// while a task cannot be met. With
//
//   ε² = max(ε_0², ‖f‖/L)
//
// the acceleration due to f changes by at most 2 L per unit of s, for any target.
//
// That is of the identity as metric. In another one the rows of J L⁻ᵀ have another length than
// those of J: an orientation's may be twenty times as long, since wrists are light, and a position's
// half as long. So s is a singular value of D⁻¹ J L⁻ᵀ, and χ is that of D⁻¹ G D⁻¹, with D the ratio
// of both lengths for the rows of a part of an error, a position or an orientation. An exact inverse
// does not depend on D. docs/edge.md has the propositions, and the origin of each constant.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/records.hpp>

namespace hsp {

// Parameters of the thresholds, and of the range of the exact law; the values and their reasons are
// in `hsp_control/edge/constants.py`.
struct Following {
  double size;      // the robot's [m]; 0: they do not follow
  double steepest;  // L [rad/s² for each unit of a singular value]; inf: it does not follow
  double modest;    // f_0 [m/s² or rad/s²]; 0 on a fixed base
  double below;     // factor of L below an unmet level
  double turning;   // ε per rad/s of a field while a spring is saturated [s], times the size
  double quickest;  // the largest part of a field that is used [rad/s]
  double near;      // σ_x: the exact law applies fully above [m]
  double far;       // part of the largest error up to which it applies fully
};

// The thresholds below which the inverses of the levels are bounded.
struct Thresholds {
  InOut<'l'> own;      // ε of each level
  InOut<'l'> follows;  // the part of it that follows f
  InOut<'m'> units;    // D, of each row
};

// Commands of the rows of the stack, level after level.
struct Demand {
  Ints<'l'> ends;      // where each level's rows end
  Ints<'p'> parts;     // where the rows of each part of an error end
  In<'m'> demand;      // f, the feedback's command at rest
  In<'m'> yields;      // factor of L for a row; 0: it is not active
  In<'m'> pulls;       // force of a spring relative to its largest
  Flags<'m'> springs;  // whether a row is that of a spring
  In<'m'> stretched;   // length of an error relative to its largest

  void check() const {
    check_ends("ends", ends, demand.size());
    check_ends("parts", parts, demand.size());
  }
};

// The ε that a field needs while a spring is saturated.
template <class G> double turning_threshold(const G& g, const Following& following) {
  return following.turning * std::min(g.norm(), following.quickest);
}

// Overwrite B = J L⁻ᵀ by D⁻¹ B, and write D. Thresholds that follow nothing are in the metric's
// units: D = 1.
template <class J, class B>
void write_units(const J& jacobian, B& whitened, const Demand& rows, const Following& following,
                 Thresholds& thresholds) {
  auto& units = thresholds.units;
  units.setOnes();
  if (!(following.size > 0.0)) return;
  Index start = 0;
  for (Index part = 0; part < rows.parts.size(); ++part) {
    const Index size = rows.parts[part] - start;
    const double plain = jacobian.middleRows(start, size).squaredNorm();
    const double longer = whitened.middleRows(start, size).squaredNorm();
    if (longer > plain && plain > 0.0) {
      const double unit = std::sqrt(longer / plain);
      units.segment(start, size).setConstant(unit);
      whitened.middleRows(start, size) /= unit;
    }
    start = rows.parts[part];
  }
}

// Write the threshold of each level; return a singular value of the stack D⁻¹ J L⁻ᵀ from which on
// no level is bounded. The law is exact from ε_0 on in the metric's own units, whatever D is.
inline double write_thresholds(const Demand& rows, double least, double turning,
                               const Following& following, Thresholds& thresholds) {
  least /= std::max(1.0, greatest(thresholds.units));
  double largest = least;
  bool below = false;  // others
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
    double beyond = std::max(std::sqrt(square) - following.modest, 0.0);
    if (beyond > 0.0) beyond *= 1.0 + more / square;
    const double follows = std::sqrt(beyond / following.steepest);
    const double own = std::max({least, follows, std::min(pull, 1.0) * turning});
    largest = std::max(largest, own);
    // No s is below that of the stack: `threshold_below` is not above it then.
    if (below) largest = std::max(largest, std::cbrt(follows * follows * following.size));
    thresholds.own[level] = own;
    thresholds.follows[level] = follows;
    below |= sprung || tracks;
    start = rows.ends[level];
  }
  return largest;
}

// The least ε of a level below others. It commands f - J a_f; `held` is how far the levels above
// are unmet, and `above` their smallest singular value, inf if none is near a singularity.
template <class F>
double threshold_below(const F& demand, double held, double above, Index level,
                       const Following& following, const Thresholds& thresholds) {
  const double beyond = std::max(demand.norm() - following.modest, 0.0);
  const double follows = thresholds.follows[level];
  const double square = held * following.below * beyond / following.steepest;
  return std::sqrt(square + follows * follows * following.size / above);
}

// How far a level is unmet at the workspace boundary, from 0 (exact) to nearly 1, by ‖f - J a_f‖²,
// its unmet command at rest, and ‖f‖². It grows slowly with the command that its threshold follows:
// if it grew as fast as lower levels are released, both would oscillate.
inline double how_held(double lacking, double wanted, double least, const Following& following) {
  const double beyond = std::sqrt(wanted) - following.modest;
  if (beyond <= 0.0) return 0.0;
  const double lacks = std::min(std::sqrt(lacking / wanted), 1.0);
  return lacks * beyond / (beyond + following.steepest * least * least + following.modest);
}

}  // namespace hsp
