// A plan from a file, with its memory and its robots; see `hsp_control/frozen/image.py`, which
// writes it.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "../dynamics/dynamics.hpp"
#include "../src/call.hpp"
#include "../src/move.hpp"
#include "../src/plan.hpp"
#include "../streams/stream.hpp"
#include "bytes.hpp"
#include "evolve.hpp"
#include "evolve_impedance.hpp"
#include "payloads.hpp"

namespace hsp::frozen {

// The part of a message that an input of a stream sets.
enum class SentTo : char { TARGET = 't', VELOCITY = 'v', RATE = 'r', TIME = 'c' };

// An array of the plan that has a name outside of it.
struct Port {
  std::string name, unit, meaning;
  char entry;  // 'd' or 'i'
  std::int64_t size;
  void* data;
  // The receivers of a set value; all are null for an output.
  Evolve* input = nullptr;
  Stream* stream = nullptr;
  SentTo part = SentTo::TARGET;  // of a message to a stream
  Payloads* payloads = nullptr;
  Index frame = 0;  // of a payload
  EvolveImpedance* impedance = nullptr;
  Index first = 0, count = 0;  // of which numbers of an impedance
  bool is_input() const { return input || stream || payloads || impedance; }
};

class FrozenPlan {
 public:
  // Throws std::exception if the file is not one of this library, or is inconsistent.
  explicit FrozenPlan(const std::string& file);
  FrozenPlan(const FrozenPlan&) = delete;

  void restart() { std::memcpy(arena_.get(), initial_.data(), initial_.size()); }
  Move& move() const { return *static_cast<Move*>(move_); }
  // The plan of the safe stop; itself if there is none.
  Move& stop() const { return *static_cast<Move*>(stop_); }
  const std::vector<Port>& ports() const { return ports_; }
  // Null if there is none.
  const Port* port(std::string_view name) const;
  // Throws std::runtime_error if there is none of this size and type.
  template <class T> T* array(const char* name, Index size) const {
    const Port* found = port(name);
    const char entry = std::is_integral_v<T> ? 'i' : 'd';
    if (!found || found->size != size || found->entry != entry)
      throw std::runtime_error(std::string("it has no array ") + name);
    return static_cast<T*>(found->data);
  }

 private:
  struct Aligned {
    void operator()(char* memory) const { ::operator delete(memory, alignment); }
  };
  static constexpr std::align_val_t alignment{64};

  // A shared object or a call: an address for each type that it can have.
  struct Object {
    std::unique_ptr<Dynamics> dynamics;
    std::unique_ptr<Call> call;
    std::unique_ptr<Plan> plan;
    Plan::Row row() const;
  };

  void read_memory(Bytes& bytes);
  void read_object(Bytes& bytes);
  void read_port(Bytes& bytes);
  Argument read_argument(Bytes& bytes, const Kind& kind, const Field& field);
  Argument read_array(Bytes& bytes, const Field& field);
  template <class Kind> Kind& input(Bytes& bytes) const;
  const Object& object(std::uint32_t index) const;
  void* shared(std::uint32_t index, std::string_view type) const;

  std::unique_ptr<char, Aligned> arena_;
  std::string initial_;  // the arena as it was in the file
  std::string entries_;  // the type of which each byte of it is; 0: of none so far
  std::vector<Object> objects_;
  std::vector<Port> ports_;
  void *move_ = nullptr, *stop_ = nullptr;
};

}  // namespace hsp::frozen
