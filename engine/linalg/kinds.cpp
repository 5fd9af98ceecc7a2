#include "../src/rooms.hpp"
#include "calls.hpp"

namespace hsp {
const Kind* const* linalg_kinds() {
  return kinds<Cholesky, SolveLower, SolveLowerTransposed, OrthonormaliseRows, OrthogonaliseRows,
               TriangulariseRows, SmallestSingularValueBound>();
}
}  // namespace hsp
