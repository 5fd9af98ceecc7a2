// From Python's arguments to those of a call: arrays by their memory, numbers, shared objects.
#pragma once
#include <nanobind/nanobind.h>

#include <string>
#include <vector>

#include "call.hpp"

namespace hsp {

// The values for the fields of a kind, in their order. A group is given as a record of its
// members, which is a named tuple or a dict, or member by member: "task.error". Throws
// nb::type_error where an argument is missing, unknown, given twice or not by its name.
nanobind::tuple values_of(const Kind& kind, nanobind::args by_order, nanobind::kwargs by_name);

// Throws nb::type_error where a value does not fit its field.
std::vector<Argument> arguments_of(const Kind& kind, nanobind::tuple values);

// "Circle(rate, center: reads float64 (d,), ...)"
std::string signature(const Kind& kind);

std::string text_of(nanobind::handle x);

}  // namespace hsp
