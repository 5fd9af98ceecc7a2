// The kinds of each room; a room's own `kinds.cpp` lists them.
#pragma once
#include <hsp/kind.hpp>
#include <vector>

namespace hsp {

const Kind* const* limit_kinds();
const Kind* const* qp_kinds();
const Kind* const* trajectory_kinds();

inline std::vector<const Kind* const*> rooms() { return {limit_kinds(), qp_kinds(), trajectory_kinds()}; }

}  // namespace hsp
