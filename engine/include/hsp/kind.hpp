// A kind of call: a struct whose members are its arguments, and whose operator() is its
// mathematics.
//
//   struct Centering {                 // the only declaration of its arguments
//     static constexpr const char* doc = "f = k (q - m)²/2 for each joint.";
//     In<'n'> q, middle;
//     double stiffness;                // a number: it does not change
//     Out<'n'> gradient;
//     Scratch<'n'> away;               // no argument
//     void operator()() { ... }        // or operator()(double t)
//     void check() const { ... }       // optional: throws if arguments are inconsistent
//   };
//
// A group may have a `check`, too. Indices are checked there, when the call is made
// (`indices.hpp`), and not again in a step.
//
// operator() returns a number with one meaning, given in `doc`: a value (f of a cost), or a bool.
// Further results of a call are written into a record with names (`LawOutcome`).
//
// The members are read into a table in C's layout, and everything common to all kinds is written
// once, over that table: the checks of shapes and entries, the Python interface, the inputs and
// outputs of a call. So a user's own library can declare kinds: it needs this header, Eigen and
// Boost's headers, and neither Python nor this package's other sources.
#pragma once
#include <boost/pfr/core.hpp>
#include <boost/pfr/core_name.hpp>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include <hsp/view.hpp>

namespace hsp {

struct Field {
  const char* name;    // "task.error" for a member of a group
  const char* object;  // the type of a shared object
  Access access;
  Order order;
  char entry;         // 'd': double, 'i': int64, 'b': bool
  std::int32_t rank;  // of an array
  std::int32_t shape[3];
  std::int64_t offset;  // of the member in the struct
  void (*bind)(void* member, void* data, const std::int64_t* shape);
};

struct Kind {
  const char* name;
  const char* doc;
  bool timed;  // whether it is a function of the time
  std::int64_t size, alignment, count;
  const Field* fields;
  void (*construct)(void* self);
  void (*destroy)(void* self);
  // Returns null, or why the arguments do not fit. No exception crosses from one library into
  // another: a wheel's engine has zig's C++ runtime, a kind compiled here has this computer's.
  const char* (*prepare)(void* self, const Sizes& size);
  double (*run)(void* self, double t);
};

namespace detail {

template <class T>
concept IsView = requires {
  T::access;
  T::shape;
};
template <class T>
concept IsShared = requires { T::Type::type_name; };
template <class T>
concept IsMemory = requires(T x, const Sizes& size) { x.prepare(size); };

template <class T> constexpr char entry_of() {
  if constexpr (std::is_same_v<T, bool>) return 'b';
  return std::is_integral_v<T> ? 'i' : 'd';
}

// Names live as long as the library that they are in.
inline const char* kept(std::string_view text) { return (new std::string(text))->c_str(); }

template <class T>
void collect(const char* start, const std::string& prefix, T& x, std::vector<Field>& found) {
  boost::pfr::for_each_field_with_name(x, [&](std::string_view name, auto& member) {
    using M = std::remove_cvref_t<decltype(member)>;
    static_assert(!std::is_pointer_v<M>, "a call has no pointers; declare an In, Out or InOut");
    const std::string full = prefix + std::string(name);
    const std::int64_t offset = reinterpret_cast<const char*>(&member) - start;
    if constexpr (IsView<M>) {
      found.push_back({kept(full),
                       nullptr,
                       M::access,
                       M::order,
                       entry_of<typename M::Scalar>(),
                       M::rank,
                       {M::shape[0], M::shape[1], M::shape[2]},
                       offset,
                       &M::bind});
    } else if constexpr (std::is_arithmetic_v<M>) {
      const auto bind = [](void* self, void* number, const std::int64_t*) {
        *static_cast<M*>(self) = static_cast<M>(*static_cast<double*>(number));
      };
      found.push_back(
          {kept(full), nullptr, Access::Number, Order::Rows, entry_of<M>(), 0, {}, offset, bind});
    } else if constexpr (IsShared<M>) {
      const auto bind = [](void* self, void* object, const std::int64_t*) {
        static_cast<M*>(self)->object = static_cast<typename M::Type*>(object);
      };
      found.push_back(
          {kept(full), M::Type::type_name, Access::Object, Order::Rows, 'o', 0, {}, offset, bind});
    } else if constexpr (!IsMemory<M>) {
      collect(start, full + ".", member, found);
    }
  });
}

template <class T> void prepare(T& x, const Sizes& size) {
  boost::pfr::for_each_field(x, [&](auto& member) {
    using M = std::remove_cvref_t<decltype(member)>;
    if constexpr (IsMemory<M>) member.prepare(size);
    else if constexpr (!IsView<M> && !IsShared<M> && !std::is_arithmetic_v<M>)
      prepare(member, size);
  });
  if constexpr (requires { x.check(); }) x.check();
}

template <class T> consteval std::string_view type_text() {
  return __PRETTY_FUNCTION__;  // "... [with T = hsp::Circle; ...]"
}
template <class T> consteval std::string_view type_name() {
  constexpr auto text = type_text<T>();
  constexpr auto begin = text.find("T = ") + 4, end = text.find_first_of(";]", begin);
  constexpr auto full = text.substr(begin, end - begin);
  return full.substr(full.find_last_of(':') + 1);
}

}  // namespace detail

// In a build with Eigen's assertions an allocation within a call is one of them.
class Allocation {
 public:
#ifdef EIGEN_RUNTIME_NO_MALLOC
  explicit Allocation(bool allowed) : before_(Eigen::internal::is_malloc_allowed()) {
    Eigen::internal::set_is_malloc_allowed(allowed);
  }
  ~Allocation() { Eigen::internal::set_is_malloc_allowed(before_); }

 private:
  bool before_;
#else
  explicit Allocation(bool) {}
#endif
};

template <class T> constexpr bool is_timed = requires(T x) { x(0.0); };

namespace detail {

template <class T> void construct(void* self) { new (self) T{}; }
template <class T> void destroy(void* self) { static_cast<T*>(self)->~T(); }

template <class T> const char* make_ready(void* self, const Sizes& size) {
  static thread_local std::string reason;
  try {
    prepare(*static_cast<T*>(self), size);
    return nullptr;
  } catch (const std::exception& error) {
    reason = error.what();
  }
  return reason.c_str();
}

template <class T> double run(void* self, double t) {
  [[maybe_unused]] const Allocation allocation(false);
  T& x = *static_cast<T*>(self);
  const auto call = [&] {
    if constexpr (is_timed<T>) return x(t);
    else return x();
  };
  if constexpr (std::is_void_v<decltype(call())>) {
    call();
    return 0.0;
  } else {
    return static_cast<double>(call());
  }
}

template <class T> std::vector<Field> fields() {
  std::vector<Field> found;
  T x{};
  collect(reinterpret_cast<const char*>(&x), "", x, found);
  return found;
}

}  // namespace detail

// The table of a struct's members, made once.
template <class T> const Kind& kind_of() {
  static_assert(
      requires { T::doc; }, "a kind needs a description: static constexpr const char* doc");
  static const std::vector<Field> fields = detail::fields<T>();
  static const Kind kind = {.name = detail::kept(detail::type_name<T>()),
                            .doc = T::doc,
                            .timed = is_timed<T>,
                            .size = sizeof(T),
                            .alignment = alignof(T),
                            .count = static_cast<std::int64_t>(fields.size()),
                            .fields = fields.data(),
                            .construct = &detail::construct<T>,
                            .destroy = &detail::destroy<T>,
                            .prepare = &detail::make_ready<T>,
                            .run = &detail::run<T>};
  return kind;
}

// The kinds of a room or of a library, ended by a null pointer.
template <class... T> const Kind* const* kinds() {
  static const Kind* const all[] = {&kind_of<T>()..., nullptr};
  return all;
}

}  // namespace hsp
