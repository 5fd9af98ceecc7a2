// Functions that Python calls by themselves: of few numbers, with new arrays as results.
#include <hsp/rotations.hpp>

#include "../trajectories/smooth_step.hpp"
#include "functions.hpp"

#include <nanobind/eigen/dense.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/tuple.h>

namespace hsp {

namespace {
using Rows3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;  // as NumPy's matrices lie
}

void bind_functions(nanobind::module_& m) {
  using namespace nanobind::literals;
  m.def("stumpff", &stumpff, "s"_a);
  m.def("exp3", [](const Vector3& y) -> Rows3 { return exp3(y); }, "y"_a);
  m.def("jexp3", [](const Vector3& y) -> Rows3 { return jexp3(y); }, "y"_a);
  m.def(
      "jexp3_dot",
      [](const Vector3& y, const Vector3& y_dot) -> Rows3 { return jexp3_dot(y, y_dot); }, "y"_a,
      "y_dot"_a);
  m.def("jlog3", [](const Vector3& y) -> Rows3 { return jlog3(y); }, "y"_a);
  m.def("log3", [](const Rows3& R) -> Vector3 { return log3(R); }, "R"_a);
  m.def(
      "quaternion_from_rotation",
      [](const Rows3& R) -> Eigen::Vector4d { return quaternion_from_rotation(R).coeffs(); },
      "R"_a);
  m.def(
      "rotation_from_quaternion",
      [](const Eigen::Vector4d& q) -> Rows3 { return rotation_from_quaternion(q); }, "q"_a);
  m.def(
      "smooth_step",
      [](double t, double start_time, double duration) {
        const auto [s, s_dot, s_ddot] = smooth_step(t, start_time, duration);
        return std::tuple(s, s_dot, s_ddot);
      },
      "t"_a, "start_time"_a, "duration"_a);
}

}  // namespace hsp
