// The part of ros2_control that ros2_controller.cpp uses, with the interfaces of Humble or of a later one.
#pragma once
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace rclcpp {

struct Time {
  double reading;
  double seconds() const { return reading; }
};
struct Duration {};
struct Logger {};

struct Parameter {
  std::variant<std::string, std::vector<std::string>> value;
  std::string as_string() const { return std::get<0>(value); }
  std::vector<std::string> as_string_array() const { return std::get<1>(value); }
};

}  // namespace rclcpp

#define RCLCPP_ERROR(logger, ...) (static_cast<void>(logger), std::fprintf(stderr, __VA_ARGS__))
#define PLUGINLIB_EXPORT_CLASS(type, base) static_assert(std::is_base_of_v<base, type>);

namespace rclcpp_lifecycle {

struct State {};

struct LifecycleNode {
  std::map<std::string, rclcpp::Parameter> parameters;
  rclcpp::Parameter get_parameter(const std::string& name) const { return parameters.at(name); }
  rclcpp::Logger get_logger() const { return {}; }
};

}  // namespace rclcpp_lifecycle

namespace hardware_interface {

struct LoanedStateInterface {
  const double* value;
#ifdef HUMBLE
  double get_value() const { return *value; }
#else
  std::optional<double> get_optional() const { return *value; }
#endif
};

struct LoanedCommandInterface {
  double* value;
#ifdef HUMBLE
  void set_value(double given) { *value = given; }
#else
  [[nodiscard]] bool set_value(double given) {
    *value = given;
    return true;
  }
#endif
};

}  // namespace hardware_interface

namespace controller_interface {

enum class CallbackReturn : unsigned char { SUCCESS = 97, FAILURE = 98, ERROR = 99 };
enum class return_type : unsigned char { OK = 0, ERROR = 1 };
enum class interface_configuration_type : unsigned char { ALL = 0, INDIVIDUAL = 1, NONE = 2 };

struct InterfaceConfiguration {
  interface_configuration_type type;
  std::vector<std::string> names = {};
};

class ControllerInterface {
 public:
  virtual ~ControllerInterface() = default;
  virtual CallbackReturn on_init() = 0;
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State&) = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State&) = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual return_type update(const rclcpp::Time&, const rclcpp::Duration&) = 0;

  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() const { return node_; }
  template <class T> void auto_declare(const std::string& name, const T& value) {
    node_->parameters.emplace(name, rclcpp::Parameter{value});
  }
  void assign(double* effort, const double* state, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) command_interfaces_.push_back({effort + i});
    for (std::size_t i = 0; i < 2 * count; ++i) state_interfaces_.push_back({state + i});
  }

 protected:
  std::vector<hardware_interface::LoanedCommandInterface> command_interfaces_;
  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

 private:
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ =
      std::make_shared<rclcpp_lifecycle::LifecycleNode>();
};

}  // namespace controller_interface
