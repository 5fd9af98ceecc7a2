// The kinds of each room; a room's own `kinds.cpp` lists them.
#pragma once
#include <hsp/kind.hpp>
#include <vector>

namespace hsp {

const Kind* const* contact_kinds();
const Kind* const* robot_kinds();
const Kind* const* task_kinds();
const Kind* const* trajectory_kinds();

inline std::vector<const Kind* const*> rooms() {
  return {contact_kinds(), robot_kinds(), task_kinds(), trajectory_kinds()};
}

}  // namespace hsp
