// Steps of integrators in the chart q = base ⊕ δ, where δ' = v for joints of one freedom.
//
// q and base are empty where the chart is not linear: then Python computes q and δ'.
#pragma once
#include <hsp/indices.hpp>

namespace hsp {

struct EulerStep {
  static constexpr const char* doc = "Semi-implicit: v ← v + h v', moved = h v, q ← q + moved.";
  In<1> h;
  In<'n'> a;  // v'
  InOut<'q'> q;
  InOut<'n'> v;
  Out<'n'> moved;

  void check() const { check_at_least("moved", moved.size(), q.size()); }
  void operator()() {
    v += h[0] * a;
    moved = h[0] * v;
    q += moved.head(q.size());
  }
};

struct Rk4Begin {
  static constexpr const char* doc = "Keep q and v, and write the first slope of δ.";
  In<'q'> q;
  In<'n'> v;
  Out<'q'> base;
  Out<'n'> v0;
  InOut<4, 'n'> D;

  void operator()() {
    base = q;
    v0 = v;
    D.row(0) = v.transpose();
  }
};

// D_i and A_i are the slopes of δ and of v at the stage i, and A_i is the v' that was computed
// there. A stage leads to the fraction c of the step, 1/2, 1/2 and 1.
struct Rk4Stage {
  static constexpr const char* doc = "δ = c h D_i, v = v0 + c h A_i, D_{i+1} = v, q = base + δ.";
  int stage;
  double fraction;
  In<1> h;
  InOut<4, 'n'> D, A;
  In<'n'> a;
  In<'q'> base;
  In<'n'> v0;
  Out<'n'> delta;
  Out<'q'> q;
  Out<'n'> v;

  void check() const {
    check_index("stage", stage, 3);
    check_at_least("delta", delta.size(), q.size());
  }
  void operator()() {
    A.row(stage) = a.transpose();
    delta = fraction * h[0] * D.row(stage).transpose();
    v = v0 + fraction * h[0] * a;
    D.row(stage + 1) = v.transpose();
    q = base + delta.head(q.size());
  }
};

struct Rk4End {
  static constexpr const char* doc =
      "δ = h/6 (D_0 + 2 D_1 + 2 D_2 + D_3), v = v0 + h/6 (A_0 + 2 A_1 + 2 A_2 + A_3).";
  In<1> h;
  InOut<4, 'n'> D, A;
  In<'n'> a;
  In<'q'> base;
  In<'n'> v0;
  Out<'n'> delta;
  Out<'q'> q;
  Out<'n'> v;

  void check() const { check_at_least("delta", delta.size(), q.size()); }
  void operator()() {
    A.row(3) = a.transpose();
    const auto sum = [](const auto& K) {
      return (K.row(0) + 2.0 * K.row(1) + 2.0 * K.row(2) + K.row(3)).transpose();
    };
    delta = h[0] / 6.0 * sum(D);
    v = v0 + h[0] / 6.0 * sum(A);
    q = base + delta.head(q.size());
  }
};

}  // namespace hsp
