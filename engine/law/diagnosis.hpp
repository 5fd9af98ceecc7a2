// How near the law is to a singular posture and to rest.
#pragma once
#include <hsp/indices.hpp>

#include "pseudo_inverse.hpp"

namespace hsp {

struct Diagnose {
  static constexpr const char* doc =
      "Write T, triangular with the singular values of J L⁻ᵀ, and ‖e_N‖_W; return the product of "
      "the squares of those values.";
  In<'m', 'n'> J;
  In<'n', 'n'> W, L;
  int form;
  In<'n'> e_N;
  Out<'s', 's'> T;  // the smaller of m and n
  Out<1> length;
  struct Memory {
    Scratch<'n'> We_N;
    Scratch<'m', 'n'> wide;
    Scratch<'n', 'm'> tall;
    void prepare(const Sizes& size) {
      We_N.prepare(size);
      wide.prepare(size);
      tall.prepare(size);
    }
  } memory;

  void check() const {
    if (T.rows() != std::min(J.rows(), J.cols()))
      throw std::invalid_argument("T is square, of the smaller size of J");
  }
  double operator()() {
    auto& [We_N, wide, tall] = memory;
    We_N.noalias() = W * e_N;
    length[0] = std::sqrt(e_N.dot(We_N));
    whiten(J, L, form, wide);
    if (J.rows() <= J.cols()) return triangle_of(wide);
    tall = wide.transpose();
    return triangle_of(tall);
  }

  template <class B> double triangle_of(B& rows) {
    const double product = triangularise_rows(rows);
    for (Index i = 0; i < T.rows(); ++i) T.row(i).head(i + 1) = rows.row(i).head(i + 1);
    return product;
  }
};

struct SingularValues {
  static constexpr const char* doc =
      "Write the singular values of a triangle, the largest first; T is overwritten.";
  InOut<'s', 's'> T;
  Out<'s'> values;

  void operator()() {
    // Of a triangle, one-sided Jacobi needs fewer sweeps than of the matrix that it factorises.
    Matrix none;
    orthogonalise_rows(T, none);
    values = T.rowwise().norm();
    std::sort(values.data(), values.data() + values.size(), std::greater<>());
  }
};

}  // namespace hsp
