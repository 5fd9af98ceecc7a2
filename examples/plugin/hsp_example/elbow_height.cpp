#include <hsp/records.hpp>

struct ElbowHeight {
  static constexpr const char* doc = "f = (z - height)²: ∇f = 2 (z - height) J_z and its rate.";
  hsp::FrameMotion<hsp::In> frame;
  double height;
  hsp::Out<'n'> gradient, rate;

  double operator()() {
    const auto J = frame.jacobian.row(2).transpose(), J_dot = frame.jacobian_dot.row(2).transpose();
    const double away = frame.position[2] - height;
    gradient = 2.0 * away * J;
    rate = 2.0 * (frame.velocity[2] * J + away * J_dot);
    return away * away;
  }
};

extern "C" auto hsp_kinds_1() { return hsp::kinds<ElbowHeight>(); }
