// The loop of a robot without Python: states in, efforts out, over UDP.
//
//   live CONTROLLER PORT SESSION DURATION
//
// It speaks the protocol of hsp_control/live/link.py with the simulated robot of `hsp live`;
// `start.py` starts both. With a real robot `receive` and `send` are its driver's.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <hsp_step.hpp>
#include <vector>

static_assert(std::endian::native == std::endian::little, "packets are little-endian");

namespace {

enum Kind : std::uint8_t { STATE = 1, EFFORT = 2, BYE = 3 };
constexpr int running = 1;  // the robot's phase; beyond it, the robot stops by itself

struct __attribute__((packed)) Head {
  char magic[4] = {'H', 'S', 'P', 'C'};
  std::uint8_t version = 1, kind = 0, phase = 0, zero = 0;
  std::uint32_t count = 0;  // of doubles that follow
  std::uint64_t session = 0, sequence = 0, acks = 0;
  std::int64_t stamp = 0;  // [ns]
  double t = 0.0;          // [s]
};
static_assert(sizeof(Head) == 52);

std::uint32_t crc32(const char* bytes, std::size_t size) {
  std::uint32_t crc = ~0u;
  for (std::size_t i = 0; i < size; ++i) {
    crc ^= static_cast<unsigned char>(bytes[i]);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0u);
  }
  return ~crc;
}

std::int64_t nanoseconds() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

class Robot {
 public:
  Robot(std::uint16_t port, std::uint64_t session) : session_(session) {
    sockaddr_in own{};
    own.sin_family = AF_INET;
    own.sin_port = htons(port);
    own.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socket_ = socket(AF_INET, SOCK_DGRAM, 0);
    const timeval patience{.tv_sec = 5, .tv_usec = 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    if (socket_ < 0 || bind(socket_, reinterpret_cast<sockaddr*>(&own), sizeof own) < 0)
      throw std::runtime_error("cannot listen at this port");
  }
  ~Robot() { close(socket_); }
  Robot(const Robot&) = delete;

  // Wait for a state that is newer than the last one; false if none comes.
  bool receive(Head& head, std::span<double> q, std::span<double> v) {
    char data[65536];
    for (;;) {
      peer_size_ = sizeof peer_;
      const auto size =
          recvfrom(socket_, data, sizeof data, 0, reinterpret_cast<sockaddr*>(&peer_), &peer_size_);
      if (size < 0) {
        if (newest_ == 0 && ++starting_ < 12) continue;  // the robot may take a minute to start
        return false;
      }
      if (static_cast<std::size_t>(size) < sizeof head + 4) continue;  // also the end of a turn
      const std::size_t body = size - 4;
      std::uint32_t check;
      std::memcpy(&head, data, sizeof head);
      std::memcpy(&check, data + body, 4);
      const bool whole = check == crc32(data, body) && !std::memcmp(head.magic, "HSPC", 4) &&
                         body == sizeof head + 8 * std::size_t{head.count};
      if (!whole || head.session != session_ || head.sequence <= newest_) continue;
      if (head.kind != STATE || head.count < q.size() + v.size()) continue;
      newest_ = head.sequence;
      std::memcpy(q.data(), data + sizeof head, q.size_bytes());
      std::memcpy(v.data(), data + sizeof head + q.size_bytes(), v.size_bytes());
      return true;
    }
  }

  void send(Kind kind, std::span<const double> payload = {}) {
    char data[4096];
    Head head;
    head.kind = kind;
    head.count = static_cast<std::uint32_t>(payload.size());
    head.session = session_;
    head.sequence = ++sent_;
    head.acks = newest_;
    head.stamp = nanoseconds();
    const std::size_t body = sizeof head + payload.size_bytes();
    if (body + 4 > sizeof data) return;
    std::memcpy(data, &head, sizeof head);
    if (!payload.empty()) std::memcpy(data + sizeof head, payload.data(), payload.size_bytes());
    const std::uint32_t check = crc32(data, body);
    std::memcpy(data + body, &check, 4);
    sendto(socket_, data, body + 4, 0, reinterpret_cast<const sockaddr*>(&peer_), peer_size_);
  }

  // To a robot in lockstep: it is its turn, with an empty datagram.
  void end_turn() {
    sendto(socket_, nullptr, 0, 0, reinterpret_cast<const sockaddr*>(&peer_), peer_size_);
  }

 private:
  int socket_;
  std::uint64_t session_, newest_ = 0, sent_ = 0;
  int starting_ = 0;  // how often no state has arrived yet
  sockaddr_in peer_{};
  socklen_t peer_size_ = sizeof peer_;
};

int run(char** arguments) {
  hsp::FrozenController controller(arguments[1]);
  Robot robot(static_cast<std::uint16_t>(std::atoi(arguments[2])),
              std::strtoull(arguments[3], nullptr, 10));
  const double duration = std::atof(arguments[4]);
  std::vector<double> q(controller.size_q()), v(controller.size_v()), tau(v.size());
  std::vector<double> times;  // that steps took [us]
  times.reserve(static_cast<std::size_t>(2.0 * duration / controller.period()) + 10000);
  long refused = 0, held = 0;
  Head state;
  for (bool stopping = false; held < 200;) {
    if (!robot.receive(state, q, v)) throw std::runtime_error("no state arrives");
    if (state.phase > running) throw std::runtime_error("the robot has stopped by itself");
    const std::int64_t begin = nanoseconds();
    const hsp_status status =
        stopping ? controller.stop(state.t, q, v, tau) : controller.step(state.t, q, v, tau);
    if (times.size() < times.capacity()) times.push_back(1e-3 * (nanoseconds() - begin));
    if (status < 0 && refused++ == 0)
      std::fprintf(stderr, "live: t = %g s: %s\n", state.t, controller.last_error());
    robot.send(EFFORT, tau);
    robot.end_turn();
    // Once a step is refused, or at the end: brake, and hold for 200 periods.
    stopping = stopping || status < 0 || state.t >= duration;
    held += status == HSP_HOLDING;
  }
  for (int i = 0; i < 3; ++i) robot.send(BYE);  // one may be lost
  robot.end_turn();
  std::sort(times.begin(), times.end());
  const auto part = [&](double x) {
    return times[static_cast<std::size_t>(x * (times.size() - 1))];
  };
  std::printf("%zu steps, %ld refused; a step took %.1f us, p99.9 %.1f, at most %.1f\n",
              times.size(), refused, part(0.5), part(0.999), times.back());
  return refused ? 2 : 0;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 5) {
    std::fprintf(stderr, "usage: live CONTROLLER PORT SESSION DURATION\n");
    return 2;
  }
  try {
    return run(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "live: %s\n", error.what());
    return 2;
  }
}
