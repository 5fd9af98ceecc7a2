// The part of libfranka that franka.cpp uses: an arm of seven joints whose fourth state is not finite.
#pragma once
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>

namespace franka {

struct RobotState {
  std::array<double, 7> q{0.0, 0.0, 0.0, -2.2, 0.0, 2.7, 0.785}, dq{};
};

struct Duration {
  double toSec() const noexcept { return 0.001; }
};

struct Model {
  std::array<double, 7> gravity(const RobotState&) const noexcept { return {}; }
};

struct Torques {
  Torques(const std::array<double, 7>& torques) noexcept : tau_J(torques) {}
  std::array<double, 7> tau_J{};
  bool motion_finished = false;
};

inline Torques MotionFinished(Torques torques) noexcept {
  torques.motion_finished = true;
  return torques;
}

struct Robot {
  explicit Robot(const std::string&) {}
  Model loadModel() { return {}; }
  void control(std::function<Torques(const RobotState&, Duration)> callback) {
    for (int k = 0; k < 5000; ++k) {
      RobotState state;
      if (k == 3) state.q[0] = NAN;
      if (!callback(state, {}).motion_finished) continue;
      std::printf("%d\n", k);
      return;
    }
  }
};

}  // namespace franka
