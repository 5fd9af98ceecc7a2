# find_package(hsp_step), with hsp_step_DIR as `hsp freeze --cmake-dir` prints it: the library that
# runs frozen controllers, beside its header in an installed package or in a checkout.
get_filename_component(_hsp_step_root "${CMAKE_CURRENT_LIST_DIR}/.." ABSOLUTE)
find_library(hsp_step_LIBRARY hsp_step
  PATHS "${_hsp_step_root}" "${_hsp_step_root}/../hsp_control/engine" NO_DEFAULT_PATH)
find_path(hsp_step_INCLUDE_DIR hsp_step.h PATHS "${_hsp_step_root}/include" NO_DEFAULT_PATH)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(hsp_step DEFAULT_MSG hsp_step_LIBRARY hsp_step_INCLUDE_DIR)
if(hsp_step_FOUND AND NOT TARGET hsp_step::hsp_step)
  add_library(hsp_step::hsp_step SHARED IMPORTED)
  set_target_properties(hsp_step::hsp_step PROPERTIES
    IMPORTED_LOCATION "${hsp_step_LIBRARY}"
    IMPORTED_NO_SONAME TRUE
    INTERFACE_INCLUDE_DIRECTORIES "${hsp_step_INCLUDE_DIR}")
endif()
