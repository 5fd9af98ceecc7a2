// The law of Hsu, Hauser and Sastry (1989) over a metric: equations (7) and (13).
//
// With m task rows and n degrees of freedom: J (m, n), a_x = x_d'' + feedback (m), the field g and
// its rate g' (n), the metric W (n, n), the gain K_N (n, n) [1/s], the acceleration a = v' (n). J#
// is the pseudo-inverse of `pseudo_inverse.hpp` in the metric, and P = I - J#J.
//
//   x = g - v                          the self-motion that the field still commands
//   e_N = (I - J#J) x                                            the null-space error
//   u = g' + K_N e_N - W⁻¹[ J'ᵀ w - W'(x - e_N/2) ],  w = J#ᵀ W x     φ_N = P u is (13)
//   a = J#(a_x - J'v) + (I - J#J) u                                               (7)
//
// With W = I, P u is equation (13), since J⁺J'J⁺ + (J⁺)' = P J'ᵀ(JJᵀ)⁻¹: no derivative of a
// pseudo-inverse is needed. Then V = ½ e_Nᵀ W e_N obeys V' = -e_Nᵀ W K_N e_N (Proposition 2).
// docs/law.md, Equations (7) and (13) over a metric, has the proof for every metric.
#pragma once
#include "pseudo_inverse.hpp"

namespace hsp {

// Inputs of the law: the stacked tasks, a field, a metric, the velocity and the gain [1/s].
struct LawInput {
  TaskSample<In> task;
  FieldSample<In> field;
  MetricSample<In> metric;
  int form;  // of the metric
  In<'n'> v;
  In<'n', 'n'> K_N;
  bool controls;  // false: u = 0, tasks alone, the paper's first simulation
};

// Intermediate results; `part` is PseudoInverse's memory.

struct LawMemory {
  Scratch<'n'> x, y, u, bent;
  Scratch<'m'> Jx, w, part;
  void prepare(const Sizes& size) {
    for (auto* each : {&x, &y, &u, &bent}) each->prepare(size);
    for (auto* each : {&Jx, &w, &part}) each->prepare(size);
  }
};

// Write e_N and a for an inverse J#. `bent`, the drift covector, is first J'ᵀw, then W⁻¹[...].
template <class Inverse, class E, class A>
void write_law(const LawInput& in, const Inverse& inverse, LawMemory& memory, E& e_N, A& a) {
  const auto& [J, J_dot, error, error_rate, a_x] = in.task;
  const auto& [g, g_dot] = in.field;
  const auto& [W, L, W_dot] = in.metric;
  const auto& v = in.v;
  auto& [x, y, u, bent, Jx, w, part] = memory;

  x = g - v;
  Jx.noalias() = J * x;
  inverse.apply(Jx, part, e_N);
  e_N = x - e_N;

  if (in.form == IDENTITY) y = x;
  else y.noalias() = W * x;
  inverse.apply_transposed(y, part, w);
  bent.noalias() = J_dot.transpose() * w;
  if (in.form == VARYING) {
    y = x - 0.5 * e_N;
    bent.noalias() -= W_dot * y;
  }
  raise(in.form, L, bent);  // W⁻¹
  u = g_dot - bent;
  u.noalias() += in.K_N * e_N;  // (13)
  if (!in.controls) u.setZero();

  Jx = a_x;
  Jx.noalias() -= J_dot * v;
  Jx.noalias() -= J * u;
  inverse.apply(Jx, part, a);
  a += u;  // (7)
}

}  // namespace hsp
