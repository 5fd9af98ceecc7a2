// `hsp_step.h` for C++20: sizes are checked, the handle closes itself, and a failure to open
// throws. A step throws nothing.
#pragma once
#include <hsp_step.h>

#include <memory>
#include <span>
#include <stdexcept>
#include <string>

namespace hsp {

class FrozenController {
 public:
  // Throws std::runtime_error with the reason.
  explicit FrozenController(const std::string& file) : handle_(hsp_open(file.c_str())) {
    if (!handle_) throw std::runtime_error(hsp_last_error(nullptr));
  }

  std::size_t size_q() const { return hsp_size_q(handle_.get()); }
  std::size_t size_v() const { return hsp_size_v(handle_.get()); }
  double period() const { return hsp_period(handle_.get()); }

  hsp_status step(double t, std::span<const double> q, std::span<const double> v,
                  std::span<double> tau) noexcept {
    const bool fits = q.size() == size_q() && v.size() == size_v() && tau.size() == size_v();
    return fits ? hsp_step(handle_.get(), t, q.data(), v.data(), tau.data()) : HSP_WRONG_SIZE;
  }
  hsp_status stop(double t, std::span<const double> q, std::span<const double> v,
                  std::span<double> tau) noexcept {
    const bool fits = q.size() == size_q() && v.size() == size_v() && tau.size() == size_v();
    return fits ? hsp_stop(handle_.get(), t, q.data(), v.data(), tau.data()) : HSP_WRONG_SIZE;
  }
  hsp_status restart() noexcept { return hsp_restart(handle_.get()); }
  hsp_status set(const char* name, std::span<const double> values) noexcept {
    return hsp_set(handle_.get(), name, values.data(), values.size());
  }
  hsp_status ramp(const char* name, std::span<const double> values, double duration) noexcept {
    return hsp_ramp(handle_.get(), name, values.data(), values.size(), duration);
  }
  hsp_status get(const char* name, std::span<double> values) noexcept {
    return hsp_get(handle_.get(), name, values.data(), values.size());
  }
  const char* last_error() const noexcept { return hsp_last_error(handle_.get()); }
  hsp_controller* handle() const noexcept { return handle_.get(); }

 private:
  struct Close {
    void operator()(hsp_controller* controller) const { hsp_close(controller); }
  };
  std::unique_ptr<hsp_controller, Close> handle_;
};

}  // namespace hsp
