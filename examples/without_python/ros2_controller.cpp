// A controller of ros2_control without Python. IT HAS NOT RUN ON AN ARM: it compiles with the
// headers of controller_interface 2.54 (Humble), 4.46 and 6.8; our tests run it against
// declarations of their own.
//
//   find_package(hsp_step REQUIRED)   # with -D hsp_step_DIR=$(hsp freeze --cmake-dir)
//   add_library(hsp_controller SHARED ros2_controller.cpp)
//   target_link_libraries(hsp_controller hsp_step::hsp_step)
//   ament_target_dependencies(hsp_controller controller_interface pluginlib)
//
// Parameters: `file`, what `hsp freeze` wrote, and `joints`, in the order of the frozen robot. It
// claims the effort of each joint, and reads its position and velocity; each joint has one degree
// of freedom, and is not continuous. Once a step is refused it brakes and holds, until it is
// activated again.
#include <controller_interface/controller_interface.hpp>
#include <hsp_step.hpp>
#include <limits>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <string>
#include <vector>

namespace hsp_example {

using controller_interface::CallbackReturn;
using controller_interface::interface_configuration_type;
using controller_interface::InterfaceConfiguration;
using controller_interface::return_type;

// An interface of ROS 2 Humble has a number; a later one may be without, which no step accepts.
template <class Interface> double value_of(const Interface& interface) {
  if constexpr (requires { interface.get_optional(); })
    return interface.get_optional().value_or(std::numeric_limits<double>::quiet_NaN());
  else return interface.get_value();
}

class HspController : public controller_interface::ControllerInterface {
 public:
  CallbackReturn on_init() override {
    auto_declare<std::string>("file", "");
    auto_declare<std::vector<std::string>>("joints", {});
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_configure(const rclcpp_lifecycle::State&) override {
    joints_ = get_node()->get_parameter("joints").as_string_array();
    try {
      controller_ =
          std::make_unique<hsp::FrozenController>(get_node()->get_parameter("file").as_string());
    } catch (const std::exception& error) {
      RCLCPP_ERROR(get_node()->get_logger(), "%s", error.what());
      return CallbackReturn::ERROR;
    }
    const std::size_t n = joints_.size();
    if (controller_->size_q() != n || controller_->size_v() != n) {
      RCLCPP_ERROR(get_node()->get_logger(), "the frozen robot has other joints");
      return CallbackReturn::ERROR;
    }
    for (auto* each : {&q_, &v_, &tau_}) each->assign(n, 0.0);
    return CallbackReturn::SUCCESS;
  }

  InterfaceConfiguration command_interface_configuration() const override {
    return {interface_configuration_type::INDIVIDUAL, named({"effort"})};
  }

  InterfaceConfiguration state_interface_configuration() const override {
    return {interface_configuration_type::INDIVIDUAL, named({"position", "velocity"})};
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State&) override {
    controller_->restart();
    stopping_ = false;
    refused_ = 0;
    return CallbackReturn::SUCCESS;
  }

  // Real time: nothing here allocates or locks. Times count from the first step.
  return_type update(const rclcpp::Time& time, const rclcpp::Duration&) override {
    const std::size_t n = joints_.size();
    for (std::size_t i = 0; i < n; ++i) {
      q_[i] = value_of(state_interfaces_[i]);
      v_[i] = value_of(state_interfaces_[n + i]);
    }
    const double t = time.seconds();
    const hsp_status status =
        stopping_ ? controller_->stop(t, q_, v_, tau_) : controller_->step(t, q_, v_, tau_);
    stopping_ |= status < 0;
    // Without a state nothing can brake: for a few periods the last effort is right.
    refused_ = status < 0 ? refused_ + 1 : 0;
    if (refused_ > 5) return return_type::ERROR;  // the manager stops the controller
    for (std::size_t i = 0; i < n; ++i)
      static_cast<void>(command_interfaces_[i].set_value(tau_[i]));
    return return_type::OK;
  }

 private:
  // All joints of the first interface, then all of the second one.
  std::vector<std::string> named(const std::vector<std::string>& interfaces) const {
    std::vector<std::string> names;
    for (const std::string& interface : interfaces)
      for (const std::string& joint : joints_) names.push_back(joint + "/" + interface);
    return names;
  }

  std::unique_ptr<hsp::FrozenController> controller_;
  std::vector<std::string> joints_;
  std::vector<double> q_, v_, tau_;
  bool stopping_ = false;
  int refused_ = 0;  // steps in a row
};

}  // namespace hsp_example

PLUGINLIB_EXPORT_CLASS(hsp_example::HspController, controller_interface::ControllerInterface)
