// From Python's arguments to those of a call: arrays by their memory, numbers, shared objects.
#pragma once
#include <nanobind/nanobind.h>

#include <string>
#include <vector>

#include "call.hpp"

namespace hsp {

// The leaves of nested tuples in order, and what records call them: ".task.error".
struct Leaves {
  explicit Leaves(nanobind::tuple given) { add(given, ""); }
  std::vector<nanobind::object> values;
  std::vector<std::string> names;

 private:
  void add(nanobind::tuple given, const std::string& prefix);
};

// Throws nb::type_error where an argument is not what its field says.
std::vector<Argument> arguments_of(const Kind& kind, nanobind::tuple given);

// "Circle(rate, center: reads float64 (d,), ...)"
std::string signature(const Kind& kind);

std::string text_of(nanobind::handle x);

}  // namespace hsp
