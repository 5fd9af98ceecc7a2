// A call: a kind with its arguments, checked and bound once.
#pragma once
#include <hsp/kind.hpp>
#include <memory>
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
  // One argument for each of the kind's fields, in their order. Throws std::invalid_argument if a
  // letter would denote two numbers, or a size differs from the kind's.
  Call(const Kind& kind, const std::vector<Argument>& arguments);

  double operator()(double t) const { return kind.run(self(), t); }
  void* self() const { return self_.get(); }

  const Kind& kind;

 private:
  struct Delete {
    const Kind* kind;
    void operator()(void* self) const;
  };
  std::unique_ptr<void, Delete> self_;  // the kind's struct
};

// A field's shape as text: "(m, 3)".
std::string shape_text(const Field& field);

}  // namespace hsp
