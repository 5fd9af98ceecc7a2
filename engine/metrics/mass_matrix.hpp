// The mass matrix as a metric.
#pragma once
#include <hsp/linalg.hpp>
#include <hsp/records.hpp>
#include <limits>

namespace hsp {

struct MassMatrixMetric {
  static constexpr const char* doc = "W = M/m = L Lᵀ and W' = M'/m; L is NaN if M is singular.";
  In<'n', 'n'> M;
  In<'n', 'n'> M_dot;
  double inertia;  // m [kg·m²]
  MetricSample<Out> out;

  void operator()() {
    out.W = M / inertia;
    out.W_dot = M_dot / inertia;
    // The law reports that the step is not finite.
    if (!cholesky(out.W, out.L)) out.L(0, 0) = std::numeric_limits<double>::quiet_NaN();
  }
};

}  // namespace hsp
