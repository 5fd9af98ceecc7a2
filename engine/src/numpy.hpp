// NumPy's arrays in C; `module.cpp` loads them.
#pragma once
#include <Python.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL hsp_engine_numpy
#define NO_IMPORT_ARRAY
#include <numpy/arrayobject.h>
