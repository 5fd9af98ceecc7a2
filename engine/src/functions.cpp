// Functions called directly from Python: of few numbers, with new arrays as results.
#include "functions.hpp"

#include <hsp/rotations.hpp>

#include <nanobind/stl/array.h>
#include <nanobind/stl/tuple.h>

#include "../trajectories/smooth_step.hpp"
#include "small_arrays.hpp"

namespace hsp {

void bind_functions(nanobind::module_& m) {
  using namespace nanobind::literals;
  m.def("stumpff", &stumpff, "s"_a);
  m.def("exp3", &exp3, "y"_a);
  m.def("log3", &log3, "R"_a);
  m.def("jexp3", &jexp3, "y"_a);
  m.def("jexp3_dot", &jexp3_dot, "y"_a, "y_dot"_a);
  m.def("jlog3", &jlog3, "y"_a);
  m.def("rotation_from_quaternion", &rotation_from_quaternion, "q"_a);
  m.def(
      "quaternion_from_rotation",
      [](const Matrix3& R) -> Eigen::Vector4d { return quaternion_from_rotation(R).coeffs(); },
      "R"_a);
  m.def(
      "smooth_step",
      [](double t, double start_time, double duration) {
        const auto [s, s_dot, s_ddot] = smooth_step(t, start_time, duration);
        return std::tuple(s, s_dot, s_ddot);
      },
      "t"_a, "start_time"_a, "duration"_a);
}

}  // namespace hsp
