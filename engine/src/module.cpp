// The Python module: kinds and calls, once for all kinds, by the tables of their fields.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "call.hpp"
#include "rooms.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace hsp;

namespace {

std::string text_of(nb::handle x) { return nb::cast<std::string>(nb::str(x)); }

const char* entries(char entry) {
  return entry == 'd' ? "float64" : entry == 'i' ? "int64" : "bool";
}

bool is_packed(const nb::ndarray<nb::ro>& x, Order order) {
  if (x.size() == 0) return true;  // NumPy gives such an array any strides
  std::int64_t stride = 1;
  for (std::size_t i = 0; i < x.ndim(); ++i) {
    const std::size_t axis = order == Order::Rows ? x.ndim() - 1 - i : i;
    if (x.shape(axis) > 1 && x.stride(axis) != stride) return false;
    stride *= static_cast<std::int64_t>(x.shape(axis));
  }
  return true;
}

std::string use_text(const Field& field) {
  const char* use[] = {"reads", "writes", "changes"};
  std::string text = use[static_cast<int>(field.access)];
  return text + " " + entries(field.entry) + " " + shape_text(field) +
         (field.order == Order::Columns ? ", column by column" : "");
}

// The memory of an array, not a copy: a call reads what is there when it is made.
Argument array(const Kind& kind, const Field& field, nb::handle given) {
  const std::string who = std::string(kind.name) + ": " + field.name;
  if (!nb::isinstance<nb::ndarray<nb::ro>>(given))
    throw nb::type_error(
        (who + " " + use_text(field) + "; got " + text_of(nb::repr(given))).c_str());
  const auto x = nb::cast<nb::ndarray<nb::ro>>(given);
  const bool is_entry = field.entry == 'd'   ? x.dtype() == nb::dtype<double>()
                        : field.entry == 'i' ? x.dtype() == nb::dtype<std::int64_t>()
                                             : x.dtype() == nb::dtype<bool>();
  const bool writeable =
      field.access == Access::In || nb::cast<bool>(given.attr("flags").attr("writeable"));
  if (!is_entry || static_cast<std::int32_t>(x.ndim()) != field.rank ||
      !is_packed(x, field.order) || !writeable)
    throw nb::type_error((who + " " + use_text(field) + "; got an array of " +
                          text_of(given.attr("dtype")) + " with the shape " +
                          text_of(given.attr("shape")) + " and the strides " +
                          text_of(given.attr("strides")) + (writeable ? "" : ", read-only"))
                             .c_str());
  Argument found;
  found.data = const_cast<void*>(x.data());
  for (std::size_t i = 0; i < x.ndim(); ++i) found.shape[i] = static_cast<std::int64_t>(x.shape(i));
  return found;
}

Argument number(const Kind& kind, const Field& field, nb::handle given) {
  Argument found;
  if (!nb::try_cast(given, found.number))
    throw nb::type_error((std::string(kind.name) + ": " + field.name + " is a number; got " +
                          text_of(nb::repr(given)))
                             .c_str());
  return found;
}

std::string signature(const Kind& kind) {
  std::string text = std::string(kind.name) + "(";
  for (std::int64_t k = 0; k < kind.count; ++k) {
    const Field& field = kind.fields[k];
    text += std::string(k ? ", " : "") + field.name;
    if (field.access != Access::Number) text += ": " + use_text(field);
  }
  return text + ")";
}

// The leaves of nested tuples, in order. A record names its own: they are the fields' names.
void flatten(nb::tuple given, const std::string& prefix, std::vector<nb::object>& leaves,
             std::vector<std::string>& names) {
  const nb::object fields = nb::getattr(given, "_fields", nb::none());
  std::size_t i = 0;
  for (nb::handle each : given) {
    std::string name = prefix;
    if (!fields.is_none()) name += "." + nb::cast<std::string>(fields[i]);
    ++i;
    if (nb::isinstance<nb::tuple>(each)) {
      flatten(nb::borrow<nb::tuple>(each), name, leaves, names);
    } else {
      leaves.push_back(nb::borrow(each));
      names.push_back(name);
    }
  }
}

bool ends_with(std::string_view text, std::string_view end) {
  return end.size() <= text.size() && text.substr(text.size() - end.size()) == end;
}

struct PythonCall {
  PythonCall(const Kind& kind, nb::tuple given)
      : arguments(given), call(kind, checked(kind, given)) {}

  static std::vector<Argument> checked(const Kind& kind, nb::tuple given) {
    std::vector<nb::object> leaves;
    std::vector<std::string> names;
    flatten(given, "", leaves, names);
    if (static_cast<std::int64_t>(leaves.size()) != kind.count)
      throw nb::type_error((std::string(kind.name) + " has " + std::to_string(kind.count) +
                            " arguments; got " + std::to_string(leaves.size()) + ": " +
                            signature(kind))
                               .c_str());
    std::vector<Argument> found;
    for (std::int64_t k = 0; k < kind.count; ++k) {
      const Field& field = kind.fields[k];
      if (!ends_with(std::string(".") + field.name, names[k]))
        throw nb::type_error((std::string(kind.name) + ": in the place of " + field.name +
                              " stands a record's " + names[k].substr(1))
                                 .c_str());
      found.push_back(field.access == Access::Number ? number(kind, field, leaves[k])
                                                     : array(kind, field, leaves[k]));
    }
    return found;
  }

  std::string repr() const {
    std::vector<nb::object> leaves;
    std::vector<std::string> names;
    flatten(arguments, "", leaves, names);
    std::string text = std::string(call.kind.name) + "(";
    for (std::int64_t k = 0; k < call.kind.count; ++k) {
      const Field& field = call.kind.fields[k];
      text += std::string(k ? ", " : "") + field.name + "=";
      text += field.access == Access::Number ? text_of(nb::repr(leaves[k]))
                                             : "array" + text_of(leaves[k].attr("shape"));
    }
    return text + ")";
  }

  nb::tuple arguments;  // they own the memory
  Call call;
};

nb::list names(const Kind& kind, Access one) {
  nb::list found;
  for (std::int64_t k = 0; k < kind.count; ++k)
    if (kind.fields[k].access == one || kind.fields[k].access == Access::InOut)
      found.append(kind.fields[k].name);
  return found;
}

}  // namespace

NB_MODULE(_engine, m) {
  nb::set_leak_warnings(false);
  nb::class_<Kind>(m, "Kind", "A kind of call: what its arguments are, and its mathematics.")
      .def("__repr__", &signature)
      .def(
          "__call__", [](const Kind& kind, nb::args given) { return new PythonCall(kind, given); },
          "Return a call with these arguments; those of a group may be a record.")
      .def_prop_ro("doc", [](const Kind& kind) { return kind.doc; })
      .def_prop_ro("name", [](const Kind& kind) { return kind.name; })
      .def_prop_ro("timed", [](const Kind& kind) { return kind.timed; })
      .def_prop_ro("reads", [](const Kind& kind) { return names(kind, Access::In); })
      .def_prop_ro("writes", [](const Kind& kind) { return names(kind, Access::Out); })
      .def("__reduce__", [](const Kind& kind) {
        return nb::make_tuple(nb::module_::import_("hsp_control.engine").attr("kind"),
                              nb::make_tuple(kind.name));
      });
  nb::class_<PythonCall>(m, "Call",
                         "A kind with its arguments: their memory is read when it is made.")
      .def("__repr__", &PythonCall::repr)
      .def(
          "__call__", [](const PythonCall& c, double t) { return c.call(t); }, "t"_a = 0.0)
      .def_prop_ro(
          "kind", [](const PythonCall& c) -> const Kind& { return c.call.kind; },
          nb::rv_policy::reference)
      .def_ro("arguments", &PythonCall::arguments)
      .def_prop_ro(
          "row",
          [](const PythonCall& c) {
            return nb::make_tuple(reinterpret_cast<std::int64_t>(c.call.kind.run),
                                  reinterpret_cast<std::int64_t>(c.call.self()));
          },
          "The addresses of its function f(self, t) and of self.")
      .def("__reduce__", [](const PythonCall& c) {
        return nb::make_tuple(
            nb::module_::import_("hsp_control.engine").attr("call"),
            nb::make_tuple(nb::cast(c.call.kind, nb::rv_policy::reference), c.arguments));
      });
  nb::list all;
  for (const auto* kinds : rooms())
    for (; *kinds; ++kinds) all.append(nb::cast(*kinds, nb::rv_policy::reference));
  m.attr("kinds") = all;
}
