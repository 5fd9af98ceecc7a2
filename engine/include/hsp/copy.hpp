#pragma once
#include <hsp/kind.hpp>

namespace hsp {

struct Copy {
  static constexpr const char* doc = "out = x.";
  In<'n'> x;
  Out<'n'> out;

  void operator()() { out = x; }
};

}  // namespace hsp
