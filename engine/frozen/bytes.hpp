// The bytes of a frozen plan, read one value after the other; nothing beyond their end.
#pragma once
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

namespace hsp::frozen {

class Bytes {
 public:
  explicit Bytes(std::string_view all) : rest_(all) {}

  template <class T> T number() {
    static_assert(std::is_arithmetic_v<T>);
    T value;
    std::memcpy(&value, take(sizeof(T)).data(), sizeof(T));
    return value;
  }
  std::string text() { return std::string(take(number<std::uint32_t>())); }
  // Number of items that follow, each of at least one byte.
  std::uint32_t count() {
    const auto n = number<std::uint32_t>();
    if (n > rest_.size()) fail();
    return n;
  }
  template <std::size_t n> void numbers(double* to) {
    std::memcpy(to, take(n * sizeof(double)).data(), n * sizeof(double));
  }
  std::string_view take(std::uint64_t size) {
    if (size > rest_.size()) fail();
    const auto taken = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return taken;
  }
  std::size_t left() const { return rest_.size(); }

 private:
  [[noreturn]] static void fail() {
    throw std::runtime_error("it ends too early: it was truncated, or is not a frozen controller");
  }
  std::string_view rest_;
};

// CRC-32, as zlib's: detects any change within 32 bits.
inline std::uint32_t checksum(std::string_view bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1u ? 0xedb88320u : 0u);
  }
  return ~crc;
}

}  // namespace hsp::frozen
