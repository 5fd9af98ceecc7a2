// Small matrices as arguments and results of functions: NumPy's arrays, copied.
#pragma once
#include <nanobind/nanobind.h>

#include <Eigen/Dense>

#include "numpy.hpp"

namespace nanobind::detail {

template <int rows, int columns> struct type_caster<Eigen::Matrix<double, rows, columns>> {
  using Matrix = Eigen::Matrix<double, rows, columns>;
  using Packed = Eigen::Map<
      Eigen::Matrix<double, rows, columns, columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>>;
  static constexpr int rank = columns == 1 ? 1 : 2;
  NB_TYPE_CASTER(Matrix, const_name("numpy.ndarray"))

  bool from_python(handle given, std::uint8_t, cleanup_list*) noexcept {
    const object owned = steal(PyArray_FROM_OTF(given.ptr(), NPY_DOUBLE, NPY_ARRAY_IN_ARRAY));
    if (!owned.is_valid()) {
      PyErr_Clear();
      return false;
    }
    auto* x = reinterpret_cast<PyArrayObject*>(owned.ptr());
    if (PyArray_NDIM(x) != rank || PyArray_DIM(x, 0) != rows) return false;
    if (rank == 2 && PyArray_DIM(x, 1) != columns) return false;
    value = Packed(static_cast<double*>(PyArray_DATA(x)));
    return true;
  }

  static handle from_cpp(const Matrix& found, rv_policy, cleanup_list*) noexcept {
    npy_intp shape[2] = {rows, columns};
    PyObject* x = PyArray_SimpleNew(rank, shape, NPY_DOUBLE);
    if (!x) return {};
    Packed(static_cast<double*>(PyArray_DATA(reinterpret_cast<PyArrayObject*>(x)))) = found;
    return x;
  }
};

}  // namespace nanobind::detail
