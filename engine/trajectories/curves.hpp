// Curves in closed form: a circle, a Lissajous figure, a line without end.
#pragma once
#include <cmath>
#include <hsp/records.hpp>

namespace hsp {

struct Circle {
  static constexpr const char* doc = "x(t) = c + cos(ω t + φ) r1 + sin(ω t + φ) r2.";
  double rate, phase;
  In<'d'> center;
  In<2, 'd'> radii;
  TrajectorySample<Out> out;

  void operator()(double t) {
    const double cosine = std::cos(rate * t + phase), sine = std::sin(rate * t + phase);
    const auto r1 = radii.row(0).transpose(), r2 = radii.row(1).transpose();
    out.position = center + cosine * r1 + sine * r2;
    out.velocity = rate * (cosine * r2 - sine * r1);
    out.acceleration = -rate * rate * (cosine * r1 + sine * r2);
  }
};

struct Lissajous {
  static constexpr const char* doc = "x(t) = c + a sin(ω t + φ), for each coordinate.";
  In<'d'> center, amplitudes, rates, phases;
  TrajectorySample<Out> out;

  void operator()(double t) {
    const auto a = amplitudes.array(), w = rates.array();
    const auto angle = w * t + phases.array();
    out.position = center.array() + a * angle.sin();
    out.velocity = w * a * angle.cos();
    out.acceleration = -w.square() * a * angle.sin();
  }
};

struct UniformLine {
  static constexpr const char* doc = "x(t) = x0 + t v.";
  In<'d'> start, velocity;
  TrajectorySample<Out> out;

  void operator()(double t) {
    out.position = start + t * velocity;
    out.velocity = velocity;
    out.acceleration.setZero();
  }
};

}  // namespace hsp
