#include "frozen_plan.hpp"

#include <fstream>
#include <iterator>

#include "../src/build.hpp"
#include "../src/rooms.hpp"

namespace hsp::frozen {

namespace {

constexpr std::string_view magic = "hsp_step";

std::string content_of(const std::string& file) try {
  std::ifstream stream;
  stream.exceptions(std::ios::failbit | std::ios::badbit);
  stream.open(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
} catch (const std::ios_base::failure&) {
  throw std::runtime_error("it cannot be read");
}

// The header: magic, checksum, build. Only data behind the checksum is trusted.
Bytes body_of(std::string_view content) {
  if (content.substr(0, magic.size()) != magic)
    throw std::runtime_error("it is not a frozen controller");
  Bytes bytes(content.substr(magic.size()));
  const auto sum = bytes.number<std::uint32_t>();
  if (checksum(content.substr(magic.size() + sizeof(sum))) != sum)
    throw std::runtime_error("it was changed or truncated since it was written: freeze it anew");
  const std::string build = bytes.text();
  if (build != build_text())
    throw std::runtime_error("it was frozen by " + build + "; this library is " + build_text() +
                             ": freeze it with the same");
  return bytes;
}

const Kind& kind_named(const Kind* const* kinds, const std::string& name) {
  for (; *kinds; ++kinds)
    if ((*kinds)->name == name) return **kinds;
  throw std::runtime_error("it has calls of the kind " + name +
                           ", which no step of this library makes");
}

const Kind& kind_named(const std::string& library, const std::string& name) {
  if (!library.empty()) return kind_named(library_kinds(library), name);
  if (name == kind_of<Move>().name) return kind_of<Move>();
  std::vector<const Kind*> all;
  for (const auto* kinds : step_rooms())
    for (; *kinds; ++kinds) all.push_back(*kinds);
  all.push_back(nullptr);
  return kind_named(all.data(), name);
}

constexpr int most_nested = 100;  // composite joints one within another

Joint read_joint(Bytes& bytes, int nested = 0) {
  if (nested > most_nested) throw std::runtime_error("a joint has too many parts");
  Joint joint;
  joint.name = bytes.text();
  joint.type = bytes.text();
  joint.parent = bytes.number<std::int64_t>();
  bytes.numbers<12>(joint.placement.data());
  bytes.numbers<3>(joint.axis.data());
  joint.pitch = bytes.number<double>();
  joint.leader = bytes.number<std::int64_t>();
  joint.ratio = bytes.number<double>();
  joint.offset = bytes.number<double>();
  for (auto n = bytes.count(); n > 0; --n) joint.parts.push_back(read_joint(bytes, nested + 1));
  joint.mass = bytes.number<double>();
  bytes.numbers<3>(joint.center.data());
  bytes.numbers<9>(joint.inertia.data());  // symmetric
  return joint;
}

std::unique_ptr<Dynamics> read_dynamics(Bytes& bytes) {
  std::vector<Joint> joints;
  for (auto n = bytes.count(); n > 0; --n) joints.push_back(read_joint(bytes));
  Vector3 gravity;
  bytes.numbers<3>(gravity.data());
  Vector armature(bytes.count());
  for (double& each : armature) each = bytes.number<double>();
  return std::make_unique<Dynamics>(joints, gravity, armature);
}

Index size_of(const Stream& stream, SentTo part) {
  switch (part) {
    case SentTo::TARGET:
      return stream.sent.target.size();
    case SentTo::TIME:
      return 1;
    default:
      return stream.sent.velocity.size();
  }
}

std::int64_t entries(const Argument& array, int rank) {
  std::int64_t count = 1;
  constexpr std::int64_t most = std::int64_t{1} << 40;
  for (int i = 0; i < rank; ++i) {
    if (array.shape[i] < 0 || array.shape[i] > most / std::max<std::int64_t>(count, 1))
      throw std::runtime_error("an array has an impossible shape");
    count *= array.shape[i];
  }
  return count;
}

}  // namespace

FrozenPlan::FrozenPlan(const std::string& file) {
  const std::string content = content_of(file);
  Bytes bytes = body_of(content);
  read_memory(bytes);
  for (auto n = bytes.count(); n > 0; --n) read_object(bytes);
  move_ = shared(bytes.number<std::uint32_t>(), Move::type_name);
  stop_ = shared(bytes.number<std::uint32_t>(), Move::type_name);
  if (stop().q.size() != move().q.size() || stop().v.size() != move().v.size())
    throw std::runtime_error("its stop is for another robot");
  for (auto n = bytes.count(); n > 0; --n) read_port(bytes);
}

const Port* FrozenPlan::port(std::string_view name) const {
  for (const Port& each : ports_)
    if (each.name == name) return &each;
  return nullptr;
}

Plan::Row FrozenPlan::Object::row() const {
  if (plan)
    return {[](void* self, double t) { return static_cast<Plan*>(self)->run(t); }, plan.get()};
  if (!call) throw std::runtime_error("a plan contains an object that is not a call");
  return {call->kind.run, call->self()};
}

// Arrays that overlap in Python overlap here; and each has the same alignment to the processor's
// packets, which determines the order of sums.
void FrozenPlan::read_memory(Bytes& bytes) {
  initial_ = bytes.take(bytes.number<std::uint64_t>());
  entries_.assign(initial_.size(), '\0');
  arena_.reset(static_cast<char*>(::operator new(initial_.size(), alignment)));
  restart();
}

void FrozenPlan::read_object(Bytes& bytes) {
  Object made;
  switch (bytes.number<char>()) {
    case 'd':
      made.dynamics = read_dynamics(bytes);
      break;
    case 'p': {
      std::vector<Plan::Row> rows;
      for (auto n = bytes.count(); n > 0; --n)
        rows.push_back(object(bytes.number<std::uint32_t>()).row());
      made.plan = std::make_unique<Plan>(std::move(rows));
      break;
    }
    case 'c': {
      const std::string library = bytes.text();
      const Kind& kind = kind_named(library, bytes.text());
      if (bytes.count() != static_cast<std::uint32_t>(kind.count))
        throw std::runtime_error(std::string("calls of ") + kind.name + " have other arguments");
      std::vector<Argument> arguments;
      for (std::int64_t k = 0; k < kind.count; ++k)
        arguments.push_back(read_argument(bytes, kind, kind.fields[k]));
      made.call = std::make_unique<Call>(kind, arguments);
      break;
    }
    default:
      throw std::runtime_error("it has objects of an unknown type");
  }
  objects_.push_back(std::move(made));
}

Argument FrozenPlan::read_argument(Bytes& bytes, const Kind& kind, const Field& field) {
  if (bytes.text() != field.name)
    throw std::runtime_error(std::string("calls of ") + kind.name + " have other arguments");
  Argument found;
  if (field.access == Access::Number) found.number = bytes.number<double>();
  else if (field.access == Access::Object)
    found.data = shared(bytes.number<std::uint32_t>(), field.object);
  else found = read_array(bytes, field);
  return found;
}

Argument FrozenPlan::read_array(Bytes& bytes, const Field& field) {
  Argument found;
  for (int i = 0; i < field.rank; ++i) found.shape[i] = bytes.number<std::int64_t>();
  const auto offset = bytes.number<std::uint64_t>();
  const std::uint64_t size = entries(found, field.rank) * (field.entry == 'b' ? 1 : 8);
  if (offset > initial_.size() || size > initial_.size() - offset ||
      (field.entry != 'b' && offset % 8))
    throw std::runtime_error("an array is beyond the memory");
  // A call must not overwrite an index that another one has checked by a real number.
  for (std::uint64_t at = offset; at < offset + size; ++at) {
    if (entries_[at] != '\0' && entries_[at] != field.entry)
      throw std::runtime_error("arrays of different types overlap");
    entries_[at] = field.entry;
  }
  found.data = arena_.get() + offset;
  return found;
}

void FrozenPlan::read_port(Bytes& bytes) {
  Port port;
  port.name = bytes.text();
  port.unit = bytes.text();
  port.meaning = bytes.text();
  port.entry = bytes.number<char>();
  const char role = bytes.number<char>();
  const Field field{.entry = port.entry, .rank = 1};
  if (port.entry != 'd' && port.entry != 'i') throw std::runtime_error("a port is of no type");
  const Argument array = read_array(bytes, field);
  port.size = array.shape[0];
  port.data = array.data;
  if (role == 'i') port.input = &input<Evolve>(bytes);
  else if (role == 't' || role == 'v' || role == 'r' || role == 'c') {
    port.stream = &input<Stream>(bytes);
    port.part = static_cast<SentTo>(role);
  } else if (role == 'p') {
    port.payloads = &input<Payloads>(bytes);
    const double* first = port.payloads->asked.data();
    port.frame = (static_cast<double*>(port.data) - first) / 10;
    if (port.data < first || port.frame >= port.payloads->asked.rows())
      throw std::runtime_error("a payload is of no frame");
  } else if (role == 's') {
    port.impedance = &input<EvolveImpedance>(bytes);
    const auto& numbers = port.impedance->numbers;
    port.first = static_cast<double*>(port.data) - numbers.data();
    port.count = port.size == 1 ? numbers.cols() : port.size;  // one for each row
    if (port.data < numbers.data() || port.first + port.count > numbers.size() || port.count < 1)
      throw std::runtime_error("an input is of no impedance");
  } else if (role != 'o') throw std::runtime_error("a port has no role");
  const Index size = port.input      ? port.input->x.size()
                     : port.stream   ? size_of(*port.stream, port.part)
                     : port.payloads ? 10
                                     : port.size;
  if (size != port.size || (port.is_input() && port.entry != 'd'))
    throw std::runtime_error("an input has another size");
  ports_.push_back(std::move(port));
}

template <class Kind> Kind& FrozenPlan::input(Bytes& bytes) const {
  const Object& found = object(bytes.number<std::uint32_t>());
  if (!found.call || &found.call->kind != &kind_of<Kind>())
    throw std::runtime_error("an input is invalid");
  return *static_cast<Kind*>(found.call->self());
}

const FrozenPlan::Object& FrozenPlan::object(std::uint32_t index) const {
  if (index >= objects_.size())
    throw std::runtime_error("it refers to an object that does not exist");
  return objects_[index];
}

void* FrozenPlan::shared(std::uint32_t index, std::string_view type) const {
  const Object& found = object(index);
  if (type == Plan::type_name && found.plan) return found.plan.get();
  if (type == Dynamics::type_name && found.dynamics) return found.dynamics.get();
  if (type == Move::type_name && found.call && &found.call->kind == &kind_of<Move>())
    return found.call->self();
  throw std::runtime_error("an object is not a " + std::string(type));
}

}  // namespace hsp::frozen
