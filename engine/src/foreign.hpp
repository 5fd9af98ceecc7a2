// A C function of another library whose arguments are pointers and integers, as a call.
#pragma once
#include <array>
#include <stdexcept>

#include "plan.hpp"

namespace hsp {

class Foreign {
 public:
  using Word = std::intptr_t;

  Foreign(Word address, const std::vector<Word>& words)
      : function_(reinterpret_cast<Function*>(address)) {
    if (words.size() > words_.size()) throw std::invalid_argument("at most 6 arguments");
    std::copy(words.begin(), words.end(), words_.begin());
  }

  double operator()() const {
    const auto& [a, b, c, d, e, f] = words_;
    function_(a, b, c, d, e, f);  // those that it does not have stay in registers, unread
    return 0.0;
  }

 private:
  using Function = void*(Word, Word, Word, Word, Word, Word);

  Function* function_;
  std::array<Word, 6> words_{};
};

struct Mirror {
  static constexpr const char* doc = "Copy the upper triangle of a matrix to the lower one.";
  InOutColumns<'n', 'n'> M;

  void operator()() { M.triangularView<Eigen::StrictlyLower>() = M.transpose(); }
};

}  // namespace hsp
