#pragma once
#include <nanobind/nanobind.h>

namespace hsp {

void bind_functions(nanobind::module_& m);

}  // namespace hsp
