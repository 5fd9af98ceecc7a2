// A low-pass filter of the measured velocity.
#pragma once
#include <hsp/kind.hpp>

namespace hsp {

struct FilterVelocity {
  static constexpr const char* doc =
      "y_k = Σ b_i v_(k-i) - Σ a_i y_(k-i), beginning at rest with the first v.";
  In<3> b;
  In<2> a;
  InOut<4, 'n'> past;  // v_(k-1), v_(k-2), y_(k-1), y_(k-2)
  InOutInts<1> begun;
  InOut<'n'> v;  // the measured one, and then y

  void operator()() {
    if (!begun[0]) past.rowwise() = v.transpose();
    else {
      const auto in1 = past.row(0).transpose(), in2 = past.row(1).transpose();
      const auto out1 = past.row(2).transpose(), out2 = past.row(3).transpose();
      y = b[0] * v + b[1] * in1 + b[2] * in2 - a[0] * out1 - a[1] * out2;
      past.row(1) = past.row(0);
      past.row(0) = v.transpose();
      past.row(3) = past.row(2);
      past.row(2) = y.transpose();
      v = y;
    }
    begun[0] = 1;
  }
  Scratch<'n'> y;
};

}  // namespace hsp
