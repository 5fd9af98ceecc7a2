#include "build.hpp"

#include <Eigen/Core>
#include <bit>
#include <string>

namespace hsp {

namespace {

constexpr const char* processor =
#if defined(__x86_64__)
    "x86_64";
#elif defined(__aarch64__)
    "aarch64";
#else
    "another processor";
#endif

}  // namespace

const char* build_text() {
  static const std::string text = std::string("hsp_control ") + HSP_VERSION + ", " + processor +
                                  ", " + std::to_string(sizeof(void*)) + "-byte pointers, " +
                                  (std::endian::native == std::endian::little ? "little" : "big") +
                                  "-endian, " + Eigen::SimdInstructionSetsInUse();
  return text.c_str();
}

}  // namespace hsp
