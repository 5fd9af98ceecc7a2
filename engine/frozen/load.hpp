// The external effort on the joints: a safe stop uses its value before the stop.
#pragma once
#include <algorithm>
#include <cstdlib>
#include <hsp/kind.hpp>
#include <stdexcept>

namespace hsp {

struct EstimateLoad {
  static constexpr const char* doc =
      "The load some periods ago, within ± bound: a mean of M v' - (tau - N), later a low-pass.";
  double rate;         // of the low-pass [1/s]
  double head_start;   // by how much the mean is over more time than has passed [s]
  double longest_gap;  // no change is taken across more [s]
  In<1> time;
  In<'n', 'n'> M;
  In<'n'> v, nonlinear_effects;
  In<'n'> acts;  // the effort from now on
  In<'n'> bound;
  InOut<1> learnt;  // the time over which it was estimated [s]
  InOut<1> last_time;
  InOut<'n'> last_v, driving;  // v and tau - N at the last state
  InOut<'n'> estimate;
  InOut<'w', 'n'> past;  // the last estimates, in a ring
  InOutInts<1> count;    // of the states
  Out<'n'> load;
  Scratch<'n'> change, rest;

  void check() const {
    if (!past.rows()) throw std::invalid_argument("past needs a row at least");
  }
  void operator()() {
    const double passed = time[0] - last_time[0];
    if (count[0] && passed > 0.0 && passed <= longest_gap) {
      // An impulse, M Δv - h (tau - N), moves the estimate: no velocity that is wrong by x moves it
      // by more than M x times the gain.
      learnt[0] += passed;
      const double gain = std::max(rate, 1.0 / (learnt[0] + head_start));
      change = v - last_v;
      rest.noalias() = M.lazyProduct(change);
      rest -= passed * driving;
      estimate += gain * rest - std::min(gain * passed, 1.0) * estimate;
    }
    last_v = v;
    last_time = time;
    driving = acts - nonlinear_effects;
    const Index at = std::abs(count[0] % past.rows());
    load = past.row(at).transpose().cwiseMax(-bound).cwiseMin(bound);
    past.row(at) = estimate.transpose();
    ++count[0];
  }
};

}  // namespace hsp
