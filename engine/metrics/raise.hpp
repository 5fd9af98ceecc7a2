// Covectors, such as gradients, as vectors: x ← W⁻¹ x.
#pragma once
#include <hsp/linalg.hpp>
#include <hsp/records.hpp>

namespace hsp {

// W = L Lᵀ; no solve is needed if it is the identity.
template <class L, class X> void raise(int form, const L& factor, X& covector) {
  if (form == IDENTITY) return;
  solve_lower(factor, covector);
  solve_lower_transposed(factor, covector);
}

}  // namespace hsp
