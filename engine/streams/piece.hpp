// A piece of a streamed reference: a C² function of time in local coordinates, as numbers that can
// be copied, saved and sent elsewhere.
#pragma once
#include <hsp/kind.hpp>
#include <stdexcept>
#include <string>

namespace hsp {

// x, x' and x'' in local coordinates: linear ones, then a rotation vector y about a base R_b,
// R = R_b exp(y). With y = 0 where a piece begins, y' and y'' are ω and ω' in R_b's axes.
template <template <int...> class As> struct ChartState {
  As<'n'> x, rate, acceleration;
  As<3, 3> base;
};

// A piece with its own memory.
struct OwnState {
  Vector x, rate, acceleration;
  Matrix3 base;

  void resize(Index n) {
    x.setZero(n);
    rate.setZero(n);
    acceleration.setZero(n);
    base.setIdentity();
  }
  template <class State> void operator=(const State& other) {
    x = other.x;
    rate = other.rate;
    acceleration = other.acceleration;
    base = other.base;
  }
};

// The same state in the chart in which its rotation vector is zero; the first `linear` coordinates
// are outside of it.
void rebase(OwnState& state, Index linear);

enum class PieceForm { COAST, QUINTIC, FASTEST, TOOL_COAST, TOOL_QUINTIC };

// COAST: x, x' at the start. QUINTIC: coefficients of u^k, u = (t - start)/duration. FASTEST: the
// origin and the velocity of a frame, and in it phases of constant jerk, of each coordinate: when
// it begins, x, x', x'' there, x'''.
//
// TOOL_COAST, TOOL_QUINTIC: of a pose, the same in the body's axes: the rates of the first three
// numbers are u in place of x', x' = R u, and x is the integral of that from x at the start on.
class Piece {
 public:
  static constexpr Index head = 13, phases = 10, rows = 2 + 5 * phases;
  static constexpr Index size(Index n) { return head + rows * n; }

  Piece(double* numbers, Index n) : numbers_(numbers), n_(n) {}

  bool is(PieceForm form) const { return numbers_[0] == static_cast<double>(form); }
  void set(PieceForm form) { numbers_[0] = static_cast<double>(form); }
  double& start() { return numbers_[1]; }
  double& end() { return numbers_[2]; }  // the next piece may begin earlier
  double& duration() { return numbers_[3]; }
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> base() {
    return Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers_ + 4);
  }
  Eigen::Map<Matrix> body() { return {numbers_ + head, rows, n_}; }

  void begin(PieceForm form, double start, double end, const Matrix3& base) {
    set(form);
    numbers_[1] = start;
    numbers_[2] = end;
    numbers_[3] = end - start;
    this->base() = base;
  }

  // The state at a time, which is not before the start.
  void state(double t, OwnState& out);

 private:
  void to_world_axes(double elapsed, OwnState& out);
  Vector3 moved(double elapsed, const OwnState& now);

  double* numbers_;
  Index n_;
};

inline void check_piece(Index size, Index n) {
  if (size != Piece::size(n))
    throw std::invalid_argument("piece has " + std::to_string(size) + " numbers; needs " +
                                std::to_string(Piece::size(n)));
}

}  // namespace hsp
