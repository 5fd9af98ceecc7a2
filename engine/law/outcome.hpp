// The outcome of the law in a step.
#pragma once
#include <hsp/view.hpp>

namespace hsp {

template <template <int...> class As> struct LawOutcome {
  As<1> damped_level;  // the first level whose inverse is bounded, from 1 on; 0: none is
  As<1> finite;        // whether a is finite: 0 or 1
};

}  // namespace hsp
