// Runs ros2_controller.cpp as its manager does: steps, one state that is not finite, then others.
#include <cmath>

#include "ros2_controller.cpp"

int main(int, char** arguments) {
  hsp_example::HspController controller;
  controller.on_init();
  auto& parameters = controller.get_node()->parameters;
  parameters["file"] = {std::string(arguments[1])};
  parameters["joints"] = {std::vector<std::string>{"1", "2", "3", "4", "5", "6", "7"}};
  if (controller.on_configure({}) != controller_interface::CallbackReturn::SUCCESS) return 1;
  double tau[7] = {}, state[14] = {0.0, 0.0, 0.0, -2.2, 0.0, 2.7, 0.785};
  controller.assign(tau, state, 7);
  controller.on_activate({});
  for (const std::string& each : controller.state_interface_configuration().names)
    std::printf("%s ", each.c_str());
  std::printf("\n");
  for (int k = 0; k < 40; ++k) {
    // One state is lost, and from 30 on all are.
    state[0] = k == 20 || k >= 30 ? NAN : 0.0;
    const bool ok =
        controller.update({1e9 + 0.001 * k}, {}) == controller_interface::return_type::OK;
    std::printf("%d %.17g\n", ok, tau[1]);
  }
}
