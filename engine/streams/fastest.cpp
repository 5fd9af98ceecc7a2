// The only file that includes Ruckig's headers.
#include "fastest.hpp"

#include <limits>
#include <ruckig/calculator_target.hpp>

namespace hsp {

namespace {

// Rounding errors are not a distance: Ruckig fails if there is no other.
void give(const Vector& x, std::vector<double>& to) {
  for (Index i = 0; i < x.size(); ++i) to[i] = std::abs(x[i]) < 1e-12 ? 0.0 : x[i];
}

// Synchronisation of the coordinates: the next one if Ruckig fails.
constexpr ruckig::Synchronization ways[] = {
    ruckig::Synchronization::Phase,  // on a straight line, where that is possible
    ruckig::Synchronization::Time,
    ruckig::Synchronization::None,
};

}  // namespace

struct Fastest::Memory {
  explicit Memory(std::size_t n) : input(n), calculator(n), motion(n) {
    input.min_velocity.emplace(n);
    input.per_dof_synchronization.emplace(n);
  }
  ruckig::InputParameter<ruckig::DynamicDOFs> input;
  ruckig::TargetCalculator<ruckig::DynamicDOFs> calculator;
  ruckig::Trajectory<ruckig::DynamicDOFs> motion;
};

void Fastest::resize(Index n) { memory_ = std::make_shared<Memory>(n); }

double Fastest::solve(const FastestTask& task, const OwnBounds& bounds, Piece& piece) {
  auto& [input, calculator, motion] = *memory_;
  const Index n = task.x.size();
  give(task.x, input.current_position);
  give(task.rate, input.current_velocity);
  give(task.acceleration, input.current_acceleration);
  give(task.target_rate, input.target_velocity);
  for (Index i = 0; i < n; ++i) {
    input.target_position[i] = input.target_acceleration[i] = 0.0;
    input.max_velocity[i] = bounds.speed[i] - task.drift[i];
    (*input.min_velocity)[i] = -bounds.speed[i] - task.drift[i];
    input.max_acceleration[i] = bounds.acceleration[i];
    input.max_jerk[i] = bounds.jerk[i];
  }
  input.minimum_duration.reset();
  if (task.minimum > 0.0) input.minimum_duration = task.minimum;
  input.control_interface =
      task.positions ? ruckig::ControlInterface::Position : ruckig::ControlInterface::Velocity;
  bool found = false;
  for (const auto way : ways) {
    for (Index i = 0; i < n; ++i)
      (*input.per_dof_synchronization)[i] = i < task.together ? way : ruckig::Synchronization::None;
    bool interrupted = false;
    found = input.validate<false>(false, true) &&
            calculator.calculate<false>(input, motion, 0.0, interrupted) == ruckig::Result::Working;
    if (found) break;
  }
  if (!found) return -1.0;
  auto body = piece.body();
  for (Index i = 0; i < n; ++i) {
    const ruckig::Profile& p = motion.get_profiles()[0][i];
    const auto phase = [&](Index k, double t, double x, double v, double a, double j) {
      const Index row = 2 + 5 * k;
      body(row, i) = t;
      body(row + 1, i) = x;
      body(row + 2, i) = v;
      body(row + 3, i) = a;
      body(row + 4, i) = j;
    };
    const auto& brake = p.brake;
    for (Index k = 0; k < 2; ++k) {
      const double begin = k == 0 ? 0.0 : brake.t[0];
      if (brake.duration > begin) phase(k, begin, brake.p[k], brake.v[k], brake.a[k], brake.j[k]);
      else phase(k, std::numeric_limits<double>::infinity(), 0.0, 0.0, 0.0, 0.0);
    }
    const double after = std::max(brake.duration, 0.0);
    for (Index k = 0; k < 8; ++k)
      phase(2 + k, k == 0 ? after : after + p.t_sum[k - 1], p.p[k], p.v[k], p.a[k],
            k < 7 ? p.j[k] : 0.0);
  }
  return motion.get_duration();
}

}  // namespace hsp
