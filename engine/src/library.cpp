#include <dlfcn.h>

#include <stdexcept>

#include "rooms.hpp"

namespace hsp {

const Kind* const* library_kinds(const std::string& path) {
  void* library = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!library) throw std::runtime_error(dlerror());
  // The number is that of the layout of `Kind` and `Field`.
  void* found = dlsym(library, "hsp_kinds_1");
  if (!found)
    throw std::runtime_error("it has no function hsp_kinds_1, or was built for another engine");
  const auto* kinds = reinterpret_cast<const Kind* const* (*)()>(found)();
  if (!kinds) throw std::runtime_error("its function hsp_kinds_1 returns nothing");
  return kinds;
}

}  // namespace hsp
