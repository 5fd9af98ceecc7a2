// Checks of indices, for the `check` of a kind: without them an index out of range would access
// other memory.
#pragma once
#include <hsp/view.hpp>
#include <stdexcept>
#include <string>

namespace hsp {

// Throws std::invalid_argument unless least ≤ i < size.
inline void check_index(const char* name, std::int64_t i, Index size, Index least = 0) {
  if (least <= i && i < size) return;
  const std::string allowed = std::to_string(least) + " to " + std::to_string(size - 1);
  throw std::invalid_argument(std::string(name) + " has the index " + std::to_string(i) +
                              "; needs " + (size > least ? allowed : "none, nothing is there"));
}

// Throws as `check_index` does, for every entry of a vector or a matrix.
template <class Indices>
void check_indices(const char* name, const Indices& indices, Index size, Index least = 0) {
  for (Index row = 0; row < indices.rows(); ++row)
    for (Index column = 0; column < indices.cols(); ++column)
      check_index(name, indices(row, column), size, least);
}

// Throws std::invalid_argument unless 0 ≤ begin ≤ end ≤ size.
inline void check_range(const char* name, std::int64_t begin, std::int64_t end, Index size) {
  if (0 <= begin && begin <= end && end <= size) return;
  throw std::invalid_argument(std::string(name) + " has the range from " + std::to_string(begin) +
                              " to " + std::to_string(end) + " of " + std::to_string(size));
}

// Throws std::invalid_argument unless the ends of groups of rows are in order: no end is before the
// last one, or beyond all rows.
template <class Ends> void check_ends(const char* name, const Ends& ends, Index rows) {
  Index start = 0;
  for (Index k = 0; k < ends.size(); start = ends[k++]) check_range(name, start, ends[k], rows);
}

// Throws std::invalid_argument unless a size is at least another.
inline void check_at_least(const char* name, Index size, Index least) {
  if (size < least)
    throw std::invalid_argument(std::string(name) + " has the size " + std::to_string(size) +
                                "; needs " + std::to_string(least) + " at least");
}

}  // namespace hsp
