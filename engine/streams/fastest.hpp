// The fastest motion within bounds, by Ruckig.
#pragma once
#include <hsp/view.hpp>
#include <memory>

#include "piece.hpp"

namespace hsp {

// Bounds of the magnitudes of x', x'' and x''', for each coordinate.
struct OwnBounds {
  Vector speed, acceleration, jerk;
};

// The request, in a frame that moves with the target.
struct FastestTask {
  Vector x, rate, acceleration;  // at the start; x is relative to the target
  Vector target_rate;            // x' at the end
  Vector drift;                  // velocity of the frame
  bool positions;                // whether the target is a position; else only a velocity
  Index together;                // number of leading coordinates that arrive together
  double minimum;                // the motion is not shorter [s]

  void resize(Index n) {
    for (Vector* each : {&x, &rate, &acceleration, &target_rate, &drift}) each->setZero(n);
  }
};

class Fastest {
 public:
  void resize(Index n);
  // Write the phases of the motion; return its duration, or a negative number if none is found.
  double solve(const FastestTask& task, const OwnBounds& bounds, Piece& piece);

 private:
  struct Memory;
  std::shared_ptr<Memory> memory_;  // of Ruckig
};

}  // namespace hsp
