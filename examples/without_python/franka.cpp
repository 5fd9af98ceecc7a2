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
    int refused = 0;             // periods in a row
    hsp_status reason = HSP_OK;  // why it stopped
    robot.control([&](const franka::RobotState& state, franka::Duration passed) -> franka::Torques {
      t += passed.toSec();
      std::array<double, 7> tau{};
      const hsp_status status = reason < 0 ? controller.stop(t, state.q, state.dq, tau)
                                           : controller.step(t, state.q, state.dq, tau);
      if (status < 0 && reason == HSP_OK) reason = status;  // brake from the next state on
      // Where that is refused, too, the last effort is right for a few periods; then the arm
      // brakes.
      refused = status < 0 ? refused + 1 : 0;
      if (refused > 5) throw std::runtime_error(controller.last_error());
      const std::array<double, 7> gravity = model.gravity(state);
      for (std::size_t i = 0; i < tau.size(); ++i) tau[i] -= gravity[i];
      const franka::Torques sent(tau);
      const bool ends = reason < 0 ? status == HSP_HOLDING : t >= duration;
      return ends ? franka::MotionFinished(sent) : sent;
    });
    if (reason == HSP_OK) return 0;
    std::fprintf(stderr, "franka: %s\n", hsp_status_text(reason));
    return 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "franka: %s\n", error.what());
    return 2;
  }
}
