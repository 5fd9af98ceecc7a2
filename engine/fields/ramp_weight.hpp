// Weights of fields that change.
#pragma once
#include "../trajectories/smooth_step.hpp"

namespace hsp {

struct RampWeight {
  static constexpr const char* doc = "w = a + s (b - a), with s from 0 to 1, and w'.";
  In<1> time;
  double initial, final, start, duration;
  Out<2> weight;  // w and w' [1/s]

  void operator()() {
    const auto [s, s_dot, s_ddot] = smooth_step(time[0], start, duration);
    weight[0] = initial + s * (final - initial);
    weight[1] = s_dot * (final - initial);
  }
};

struct ProductWeight {
  static constexpr const char* doc = "w = a b and w' = a' b + a b'.";
  In<2> first, second;  // a and a' [1/s], b and b'
  Out<2> weight;

  void operator()() { weight << first[0] * second[0], first[1] * second[0] + first[0] * second[1]; }
};

}  // namespace hsp
