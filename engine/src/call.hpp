// A call: a kind with its arguments, checked and bound once.
#pragma once
#include <hsp/kind.hpp>
#include <string>
#include <vector>

namespace hsp {

struct Argument {
  void* data = nullptr;
  std::int64_t shape[3] = {1, 1, 1};
  double number = 0.0;
};

class Call {
 public:
  // One argument for each of the kind's fields, in their order. Throws std::invalid_argument
  // where a letter would stand for two numbers, or a size is not as the kind has it.
  Call(const Kind& kind, const std::vector<Argument>& arguments);
  ~Call();
  Call(const Call&) = delete;
  Call& operator=(const Call&) = delete;

  double operator()(double t) const { return kind.run(self_, t); }
  void* self() const { return self_; }

  const Kind& kind;

 private:
  void* self_;
};

// A field's shape as one writes it: "(m, 3)".
std::string shape_text(const Field& field);

}  // namespace hsp
