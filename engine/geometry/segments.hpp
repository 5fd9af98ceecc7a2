// The nearest points of two segments, and how they slide.
#pragma once
#include <algorithm>
#include <hsp/view.hpp>

namespace hsp {

struct Segment {
  Vector3 start, axis;  // start + s axis, 0 ≤ s ≤ 1; a sphere's axis is zero
};

struct MovingSegment : Segment {
  Vector3 start_dot, axis_dot;
};

// A free point is inside its segment, where it can slide; a fixed one is at an end.
struct OnSegments {
  double s, t;
  bool s_free, t_free;
};

// The nearest points a + s e and b + t f (Ericson, Real-Time Collision Detection, 2005, 5.1.9).
inline OnSegments nearest_on_segments(const Segment& first, const Segment& second) {
  constexpr double parallel = 1e-13;  // threshold of sin² of the angle between them
  const auto& [a, e] = first;
  const auto& [b, f] = second;
  const Vector3 r = a - b;
  const double ee = e.squaredNorm(), ff = f.squaredNorm(), ef = e.dot(f);
  const double er = e.dot(r), fr = f.dot(r);
  double s = 0.0, t = 0.0;
  if (ff > 0.0) {
    const double square = ee * ff - ef * ef;
    if (square > parallel * ee * ff) s = std::clamp((ef * fr - er * ff) / square, 0.0, 1.0);
    t = (ef * s + fr) / ff;
  }
  if (ee > 0.0 && !(0.0 < t && t < 1.0)) {
    t = std::clamp(t, 0.0, 1.0);
    s = std::clamp((ef * t - er) / ee, 0.0, 1.0);
  }
  t = std::clamp(t, 0.0, 1.0);
  return {s, t, 0.0 < s && s < 1.0, 0.0 < t && t < 1.0};
}

struct Sliding {
  double s_dot, t_dot;
};

// With r = a - b + s e - t f, a free s obeys e·r = 0 and a free t obeys f·r = 0. The time
// derivatives of these equations are linear in s' and t'. The segments' lengths are constant.
inline Sliding nearest_rates(const MovingSegment& first, const MovingSegment& second,
                             const OnSegments& at) {
  const auto& [s, t, s_free, t_free] = at;
  if (!(s_free || t_free)) return {0.0, 0.0};
  const Vector3 &e = first.axis, &f = second.axis;
  const Vector3 &e_dot = first.axis_dot, &f_dot = second.axis_dot;
  const Vector3 r = first.start - second.start + s * e - t * f;
  const Vector3 drift = first.start_dot - second.start_dot + s * e_dot - t * f_dot;
  // ee s' - ef t' = along_e,  -ef s' + ff t' = along_f
  const double ee = e.squaredNorm(), ff = f.squaredNorm(), ef = e.dot(f);
  const double along_e = -(e_dot.dot(r) + e.dot(drift)), along_f = f_dot.dot(r) + f.dot(drift);
  if (!t_free) return {along_e / ee, 0.0};
  if (!s_free) return {0.0, along_f / ff};
  const double square = ee * ff - ef * ef;
  return {(ff * along_e + ef * along_f) / square, (ee * along_f + ef * along_e) / square};
}

}  // namespace hsp
