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
  In<4, 'd'> parameters;  // c, a, ω, φ
  TrajectorySample<Out> out;

  void operator()(double t) {
    const auto center = parameters.row(0).transpose().array();
    const auto amplitude = parameters.row(1).transpose().array();
    const auto rate = parameters.row(2).transpose().array();
    const auto angle = rate * t + parameters.row(3).transpose().array();
    out.position = center + amplitude * angle.sin();
    out.velocity = rate * amplitude * angle.cos();
    out.acceleration = -rate.square() * amplitude * angle.sin();
  }
};

struct UniformLine {
  static constexpr const char* doc = "x(t) = x0 + t v.";
  In<'d'> start, speed;
  TrajectorySample<Out> out;

  void operator()(double t) {
    out.position = start + t * speed;
    out.velocity = speed;
    out.acceleration.setZero();
  }
};

}  // namespace hsp
