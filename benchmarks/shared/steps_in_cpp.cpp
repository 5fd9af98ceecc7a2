// A loop over states known before, without Python: see steps_in_cpp.py.
#include "../engine/src/move.hpp"

#include <chrono>

struct StepsAtStates {
  static constexpr const char* doc = "Take the steps at some of the states; keep their times.";
  hsp::Shared<hsp::Move> step;
  hsp::In<'k'> t;  // [s]
  hsp::In<'k', 'q'> q;
  hsp::In<'k', 'n'> v;
  hsp::Ints<1> begin, end;  // which states
  hsp::Out<'k'> elapsed;    // [ns]

  void operator()() {
    using std::chrono::duration, std::chrono::steady_clock;
    for (hsp::Index k = begin[0]; k < end[0]; ++k) {
      const auto start = steady_clock::now();
      step->to(t[k], q.row(k).transpose(), v.row(k).transpose());
      elapsed[k] = duration<double, std::nano>(steady_clock::now() - start).count();
    }
  }
};

extern "C" auto hsp_kinds_1() { return hsp::kinds<StepsAtStates>(); }
