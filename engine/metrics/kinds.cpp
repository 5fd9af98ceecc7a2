#include "../src/rooms.hpp"
#include "mass_matrix.hpp"

namespace hsp {
const Kind* const* metric_kinds() { return kinds<MassMatrixMetric>(); }
}  // namespace hsp
