// The field of a cost f, and the weighted sum of fields.
#pragma once
#include <hsp/records.hpp>

#include "../metrics/raise.hpp"

namespace hsp {

// From W g = -∇f follows W g' = -((∇f)' + W'g).
struct GradientDescent {
  static constexpr const char* doc =
      "g = -W⁻¹∇f and g' = -W⁻¹((∇f)' + W'g), in the place of ∇f and (∇f)'.";
  In<'n', 'n'> L, W_dot;  // W = L Lᵀ
  int form;
  FieldSample<InOut> field;

  void operator()() {
    auto& [g, g_dot] = field;
    g = -g;
    raise(form, L, g);
    if (form == VARYING) g_dot.noalias() += W_dot * g;
    g_dot = -g_dot;
    raise(form, L, g_dot);
  }
};

struct AddWeighted {
  static constexpr const char* doc =
      "Scale a term, g ← w g and g' ← w g' + w'g, and add it to the sum, which it may begin.";
  bool first;
  In<2> weight;  // w and w'
  FieldSample<InOut> term, sum;

  void operator()() {
    term.g_dot = weight[0] * term.g_dot + weight[1] * term.g;
    term.g *= weight[0];
    if (first) {
      sum = term;
    } else {
      sum.g += term.g;
      sum.g_dot += term.g_dot;
    }
  }
};

}  // namespace hsp
