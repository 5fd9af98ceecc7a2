// A plan: calls that run in sequence, and calls that run a plan under a condition.
#pragma once
#include <algorithm>
#include <cmath>
#include <hsp/kind.hpp>
#include <stdexcept>
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

struct EqualSteps {
  static constexpr const char* doc =
      "Divide an interval into the fewest equal steps that are not longer than one, and make the "
      "calls of each at its beginning.";
  Shared<Plan> calls;
  In<2> interval;
  double longest;
  Out<1> now, h;
  static constexpr double most = 1e9;

  void check() const {
    if (!(longest > 0.0)) throw std::invalid_argument("longest must be more than 0");
  }
  void operator()() {
    const double start = interval[0], duration = interval[1] - start;
    const double steps = std::max(1.0, std::ceil(duration / longest - 1e-9));
    if (!(steps <= most)) throw std::invalid_argument("EqualSteps: more than 1e9 steps, or NaN");
    h[0] = duration / steps;
    for (double k = 0.0; k < steps; ++k) {
      now[0] = start + k * h[0];
      calls->run(now[0]);
    }
  }
};

}  // namespace hsp
