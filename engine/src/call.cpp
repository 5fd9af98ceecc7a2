#include "call.hpp"

#include <cstdint>
#include <stdexcept>

namespace hsp {

namespace {

std::string size_text(int size) {
  return is_letter(size) ? std::string(1, static_cast<char>(size)) : std::to_string(size);
}

template <class Sizes> std::string tuple_text(const Sizes& sizes, int rank) {
  std::string text = "(";
  for (int i = 0; i < rank; ++i) text += (i ? ", " : "") + sizes(i);
  return text + (rank == 1 ? ",)" : ")");
}

// The sizes of the letters; an error names the argument that defined each.
Sizes sizes_of(const Kind& kind, const std::vector<Argument>& arguments) {
  Sizes sizes;
  const Field* first['z' + 1] = {};
  for (std::int64_t k = 0; k < kind.count; ++k) {
    const Field& field = kind.fields[k];
    for (int i = 0; i < field.rank; ++i) {
      const int size = field.shape[i];
      const std::int64_t given = arguments[k].shape[i];
      if (is_letter(size) && !first[size]) {
        first[size] = &field;
        sizes[size] = given;
      }
      if (given == sizes(size)) continue;
      std::string text = std::string(kind.name) + ": " + field.name + " has the shape ";
      text += tuple_text([&](int j) { return std::to_string(arguments[k].shape[j]); }, field.rank);
      text += "; needs " + shape_text(field);
      if (is_letter(size))
        text += ", where " + size_text(size) + " = " + std::to_string(sizes(size)) + " as in " +
                first[size]->name;
      throw std::invalid_argument(text);
    }
  }
  return sizes;
}

std::int64_t bytes_of(const Field& field, const Argument& argument) {
  std::int64_t count = field.rank > 0 ? 1 : 0;
  for (int i = 0; i < field.rank; ++i) count *= argument.shape[i];
  return count * (field.entry == 'b' ? 1 : 8);
}

// Eigen reads an argument while it writes another one: in shared memory results would be wrong.
void check_apart(const Kind& kind, const std::vector<Argument>& arguments) {
  const auto is_written = [](const Field& field) {
    return field.access == Access::Out || field.access == Access::InOut;
  };
  for (std::int64_t k = 0; k < kind.count; ++k) {
    const Field& written = kind.fields[k];
    if (!is_written(written)) continue;
    const auto begin = reinterpret_cast<std::uintptr_t>(arguments[k].data);
    const auto end = begin + bytes_of(written, arguments[k]);
    for (std::int64_t other = 0; other < kind.count; ++other) {
      if (other == k) continue;
      const auto start = reinterpret_cast<std::uintptr_t>(arguments[other].data);
      const auto stop = start + bytes_of(kind.fields[other], arguments[other]);
      if (begin < stop && start < end && begin < end && start < stop)
        throw std::invalid_argument(std::string(kind.name) + ": " + written.name +
                                    " is written, and is memory of " + kind.fields[other].name);
    }
  }
}

}  // namespace

std::string shape_text(const Field& field) {
  return tuple_text([&](int i) { return size_text(field.shape[i]); }, field.rank);
}

Call::Call(const Kind& kind_, const std::vector<Argument>& arguments) : kind(kind_) {
  const Sizes sizes = sizes_of(kind, arguments);
  check_apart(kind, arguments);
  const auto release = [&](void* memory) {
    ::operator delete(memory, std::align_val_t(kind.alignment));
  };
  std::unique_ptr<void, decltype(release)> memory(
      ::operator new(kind.size, std::align_val_t(kind.alignment)), release);
  kind.construct(memory.get());
  self_ = std::unique_ptr<void, Delete>(memory.release(), Delete{&kind});
  for (std::int64_t k = 0; k < kind.count; ++k) {
    const Field& field = kind.fields[k];
    Argument given = arguments[k];
    void* data = field.access == Access::Number ? &given.number : given.data;
    field.bind(static_cast<char*>(self()) + field.offset, data, given.shape);
  }
  if (const char* reason = kind.prepare(self(), sizes))
    throw std::invalid_argument(std::string(kind.name) + ": " + reason);
}

void Call::Delete::operator()(void* self) const {
  kind->destroy(self);
  ::operator delete(self, std::align_val_t(kind->alignment));
}

}  // namespace hsp
