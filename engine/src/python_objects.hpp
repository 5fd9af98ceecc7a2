// Objects of Python: calls, plans, and functions of Python as calls. Each has a row: the addresses
// of a function f(self, t) and of self, which is all that a plan uses.
#pragma once
#include <nanobind/nanobind.h>

#include <stdexcept>
#include <vector>

#include "../dynamics/dynamics.hpp"
#include "arguments.hpp"
#include "move.hpp"
#include "plan.hpp"

namespace hsp {

struct Runnable {
  Plan::Row row;
  bool python;    // whether it runs a function of Python
  int depth = 0;  // depth of nested plans

  double operator()(double t) const { return row.run(row.self, t); }
};

// A kind with its arguments, which own the memory.
struct CallObject : Runnable {
  CallObject(const Kind& kind, nanobind::tuple given)
      : values(given), call(kind, arguments_of(kind, given)) {
    row = {kind.run, call.self()};
    python = runs_python(given);
    depth = depth_of(given);
  }
  static bool runs_python(nanobind::tuple given);
  static int depth_of(nanobind::tuple given);  // the largest

  nanobind::tuple values;  // in the order of the kind's fields
  Call call;
};

nanobind::dict named_values(const Kind& kind, nanobind::tuple values);

// Calls that run in sequence.
struct PlanObject : Runnable {
  explicit PlanObject(nanobind::tuple given) : calls(given), plan(rows(given)) {
    row = {[](void* self, double t) { return static_cast<Plan*>(self)->run(t); }, &plan};
    python = false;
    depth = CallObject::depth_of(given) + 1;
    if (depth > most_depth) throw std::length_error("more than 1000 plans, one within another");
    for (nanobind::handle each : given) python |= is_python(each);
  }
  PlanObject(const PlanObject&) = delete;
  static std::vector<Plan::Row> rows(nanobind::tuple given);
  static bool is_python(nanobind::handle call);
  static constexpr int most_depth = 1000;  // each uses stack memory when it runs

  nanobind::tuple calls;
  Plan plan;
};

// A function of Python, of the time or of nothing. Its result is used if it is a number.
struct PythonCall : Runnable {
  PythonCall(nanobind::object f, bool t) : function(std::move(f)), timed(t) {
    row = {[](void* self, double t) { return static_cast<PythonCall*>(self)->made(t); }, this};
    python = true;
  }
  PythonCall(const PythonCall&) = delete;
  double made(double t) const;

  nanobind::object function;
  bool timed;
};

// A robot's dynamics, with the parameters from which they were built.
struct DynamicsObject {
  // `joints` are objects with the attributes of `Joint`.
  DynamicsObject(nanobind::tuple joints, nanobind::tuple gravity, nanobind::tuple armature);
  DynamicsObject(const DynamicsObject&) = delete;

  nanobind::tuple given;
  Dynamics dynamics;
};

// A state's move from Python: refused if t is not a number, or q and v are not vectors of doubles.
struct MoveObject {
  explicit MoveObject(nanobind::tuple given);
  // None where it is refused.
  std::optional<double> operator()(nanobind::handle t, nanobind::handle q, nanobind::handle v);

  nanobind::tuple values;
  Call call;
  bool python;
  int depth;
};

}  // namespace hsp
