// The kinds of each room; a room's own `kinds.cpp` lists them.
#pragma once
#include <hsp/kind.hpp>
#include <vector>

namespace hsp {

const Kind* const* trajectory_kinds();
const Kind* const* geometry_kinds();
const Kind* const* metric_kinds();
const Kind* const* field_kinds();

inline std::vector<const Kind* const*> rooms() {
  return {trajectory_kinds(), geometry_kinds(), metric_kinds(), field_kinds()};
}

}  // namespace hsp
