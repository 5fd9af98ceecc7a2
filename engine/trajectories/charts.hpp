// Orientations in local coordinates: R = R_b exp(y) about a base R_b.
#pragma once
#include "orientations.hpp"

namespace hsp {

struct OrientationOfChart {
  static constexpr const char* doc =
      "R = R_b exp(y), ω = R Jexp y' and ω' = R (Jexp y'' + Jexp' y').";
  In<3, 3> base;
  TrajectorySample<In, 3> y;
  OrientationSample<Out> out;

  void operator()() {
    const OrientationSample<Own> at_rest{base, Vector3::Zero(), Vector3::Zero()};
    turn_from(at_rest, y, out);
  }
};

}  // namespace hsp
