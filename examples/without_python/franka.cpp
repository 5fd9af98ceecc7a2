// A Franka arm's 1 kHz callback without Python. IT HAS NOT RUN ON AN ARM: read it, run the file
// against the simulated robot first (`live.cpp`), and keep a hand on the stop.
//
//   c++ -std=c++20 franka.cpp $(hsp freeze --flags) -lfranka
//   ./a.out HOST CONTROLLER DURATION
//
// The arm adds gravity itself, so tau - g(q) is sent; and it limits rates itself, too.
#include <franka/duration.h>
#include <franka/exception.h>
#include <franka/model.h>
#include <franka/robot.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <hsp_step.hpp>

int main(int count, char** arguments) {
  if (count != 4) {
    std::fprintf(stderr, "usage: franka HOST CONTROLLER DURATION\n");
    return 2;
  }
  try {
    hsp::FrozenController controller(arguments[2]);
    if (controller.size_q() != 7 || controller.size_v() != 7)
      throw std::runtime_error("the controller is of another robot");
    franka::Robot robot(arguments[1]);
    const franka::Model model = robot.loadModel();
    const double duration = std::atof(arguments[3]);
    double t = 0.0;
    int refused = 0;
    robot.control([&](const franka::RobotState& state, franka::Duration passed) -> franka::Torques {
      t += passed.toSec();
      std::array<double, 7> tau{};
      const hsp_status status = controller.step(t, state.q, state.dq, tau);
      // For a few periods the last effort is right; then the arm brakes by itself.
      refused = status < 0 ? refused + 1 : 0;
      if (refused > 5) throw std::runtime_error(controller.last_error());
      const std::array<double, 7> gravity = model.gravity(state);
      for (std::size_t i = 0; i < tau.size(); ++i) tau[i] -= gravity[i];
      const franka::Torques sent(tau);
      return t < duration ? sent : franka::MotionFinished(sent);
    });
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "franka: %s\n", error.what());
    return 2;
  }
}
