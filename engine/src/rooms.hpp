// The kinds of each room; a room's own `kinds.cpp` lists them.
#pragma once
#include <hsp/kind.hpp>
#include <vector>

namespace hsp {

const Kind* const* compensation_kinds();
const Kind* const* contact_kinds();
const Kind* const* dynamics_kinds();
const Kind* const* edge_kinds();
const Kind* const* field_kinds();
const Kind* const* frozen_kinds();
const Kind* const* geometry_kinds();
const Kind* const* integrator_kinds();
const Kind* const* law_kinds();
const Kind* const* limit_kinds();
const Kind* const* linalg_kinds();
const Kind* const* metric_kinds();
const Kind* const* plan_kinds();
const Kind* const* qp_kinds();
const Kind* const* robot_kinds();
const Kind* const* simulation_kinds();
const Kind* const* stream_kinds();
const Kind* const* task_kinds();
const Kind* const* trajectory_kinds();

// The kinds of a library of a user's own, which stays loaded. Throws std::runtime_error.
const Kind* const* library_kinds(const std::string& path);

// Parts of a step. No part repeats anything as often as a number in memory requires, so
// that a step ends whatever its memory holds.
inline std::vector<const Kind* const*> step_rooms() {
  return {
      plan_kinds(),   compensation_kinds(), contact_kinds(),  dynamics_kinds(), edge_kinds(),
      field_kinds(),  frozen_kinds(),       geometry_kinds(), law_kinds(),      limit_kinds(),
      linalg_kinds(), metric_kinds(),       qp_kinds(),       robot_kinds(),    stream_kinds(),
      task_kinds(),   trajectory_kinds(),
  };
}

inline std::vector<const Kind* const*> rooms() {
  auto all = step_rooms();
  all.push_back(integrator_kinds());
  all.push_back(simulation_kinds());
  return all;
}

}  // namespace hsp
