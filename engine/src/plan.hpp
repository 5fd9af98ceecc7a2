// A plan: calls that run in sequence, and calls that run a plan under a condition.
#pragma once
#include <hsp/kind.hpp>
#include <vector>

namespace hsp {

class Plan {
 public:
  static constexpr const char* type_name = "Plan";
  struct Row {
    double (*run)(void* self, double t);
    void* self;
  };

  explicit Plan(std::vector<Row> rows) : rows_(std::move(rows)) {}

  // Run the calls at a time [s]; return the last one's result.
  double run(double t) const {
    double value = 0.0;
    for (const Row& row : rows_) value = row.run(row.self, t);
    return value;
  }

 private:
  std::vector<Row> rows_;
};

struct Once {
  static constexpr const char* doc = "Run calls unless they were run at this stamp.";
  Shared<Plan> calls;
  Ints<1> stamp;
  InOutInts<1> made;

  void operator()(double t) {
    if (made[0] == stamp[0]) return;
    made[0] = stamp[0];
    calls->run(t);
  }
};

struct OnlyIf {
  static constexpr const char* doc = "Run calls if a condition is not 0.";
  Shared<Plan> calls;
  Ints<1> condition;

  void operator()(double t) {
    if (condition[0]) calls->run(t);
  }
};

}  // namespace hsp
