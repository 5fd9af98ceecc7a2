#include "arguments.hpp"

#include <nanobind/stl/string.h>

#include <algorithm>
#include <cmath>

#include "numpy.hpp"
#include "python_objects.hpp"

namespace nb = nanobind;

namespace hsp {

namespace {

const char* entries(char entry) {
  return entry == 'd' ? "float64" : entry == 'i' ? "int64" : "bool";
}

std::string use_text(const Field& field) {
  if (field.access == Access::Object) return std::string("a ") + field.object;
  const char* use[] = {"reads ", "writes ", "changes "};
  std::string text = use[static_cast<int>(field.access)];
  return text + entries(field.entry) + " " + shape_text(field) +
         (field.order == Order::Columns ? ", column by column" : "");
}

[[noreturn]] void refuse(const Kind& kind, const Field& field, const std::string& given) {
  throw nb::type_error((std::string(kind.name) + ": " + field.name +
                        (field.access == Access::Object ? " is " : " ") + use_text(field) +
                        "; got " + given)
                           .c_str());
}

// The memory of an array, not a copy: a call reads its present values.
Argument array(const Kind& kind, const Field& field, nb::handle given) {
  if (!PyArray_Check(given.ptr())) refuse(kind, field, text_of(nb::repr(given)));
  auto* x = reinterpret_cast<PyArrayObject*>(given.ptr());
  const int entry = field.entry == 'd' ? NPY_DOUBLE : field.entry == 'i' ? NPY_INT64 : NPY_BOOL;
  const bool packed =
      field.order == Order::Rows ? PyArray_IS_C_CONTIGUOUS(x) : PyArray_IS_F_CONTIGUOUS(x);
  const bool writeable = field.access == Access::In || PyArray_ISWRITEABLE(x);
  if (!PyArray_EquivTypenums(PyArray_TYPE(x), entry) || PyArray_NDIM(x) != field.rank || !packed ||
      !PyArray_ISBEHAVED_RO(x) || !writeable)
    refuse(kind, field,
           "an array of " + text_of(given.attr("dtype")) + " with the shape " +
               text_of(given.attr("shape")) + " and the strides " + text_of(given.attr("strides")) +
               (writeable ? "" : ", read-only"));
  Argument found;
  found.data = PyArray_DATA(x);
  for (int i = 0; i < field.rank; ++i) found.shape[i] = PyArray_DIM(x, i);
  return found;
}

// The object of a type; null if it is of another one, or was made without its constructor.
void* shared_object(std::string_view type, nb::handle given) {
  if (!nb::inst_check(given) || !nb::inst_ready(given)) return nullptr;
  if (type == Plan::type_name && nb::isinstance<PlanObject>(given))
    return &nb::cast<PlanObject&>(given).plan;
  if (type == Move::type_name && nb::isinstance<MoveObject>(given))
    return nb::cast<MoveObject&>(given).call.self();
  if (type == Dynamics::type_name && nb::isinstance<DynamicsObject>(given))
    return &nb::cast<DynamicsObject&>(given).dynamics;
  return nullptr;
}

bool is_integer(double x) { return x == std::floor(x) && std::abs(x) <= 2147483647.0; }

Argument argument(const Kind& kind, const Field& field, nb::handle given) {
  Argument found;
  if (field.access == Access::Number) {
    const bool whole = field.entry != 'd';
    if (!nb::try_cast(given, found.number) || (whole && !is_integer(found.number)))
      throw nb::type_error((std::string(kind.name) + ": " + field.name + " is a " +
                            (whole ? "whole " : "") + "number; got " + text_of(nb::repr(given)))
                               .c_str());
  } else if (field.access == Access::Object) {
    found.data = shared_object(field.object, given);
    if (!found.data) refuse(kind, field, text_of(nb::repr(given)));
  } else {
    found = array(kind, field, given);
  }
  return found;
}

// The arguments of a call while they are read, by name.
class Given {
 public:
  explicit Given(const Kind& kind) : kind_(kind), values_(kind.count) {}

  void add(const std::string& name, nb::handle value) {
    if (nb::object* place = find(name)) {
      if (place->is_valid()) complain(": " + name + " is given twice");
      *place = nb::borrow(value);
    } else if (!is_group(name)) {
      complain(" has no argument " + name + suggestion(name));
    } else if (nb::isinstance<nb::dict>(value)) {
      for (auto [key, each] : nb::borrow<nb::dict>(value)) add(name + "." + text_of(key), each);
    } else if (nb::isinstance<nb::tuple>(value) && nb::hasattr(value, "_fields")) {
      std::size_t i = 0;
      for (nb::handle key : value.attr("_fields")) add(name + "." + text_of(key), value[i++]);
    } else {
      complain(": " + name + " is " + members(name) + "; got " + text_of(nb::repr(value)));
    }
  }

  nb::tuple all() const {
    std::string text;
    std::string_view last;
    for (std::int64_t k = 0; k < kind_.count; ++k) {
      if (values_[k].is_valid()) continue;
      const std::string_view missing = whole_group(kind_.fields[k].name);
      if (missing != last) text += std::string(text.empty() ? "" : ", ").append(missing);
      last = missing;
    }
    if (!text.empty()) complain(" needs " + text);
    nb::list found;
    for (const nb::object& each : values_) found.append(each);
    return nb::tuple(found);
  }

 private:
  // The index of a field; usually the one after the last.
  nb::object* find(std::string_view name) {
    for (std::int64_t i = 0; i < kind_.count; ++i) {
      const std::int64_t k = (next_ + i) % kind_.count;
      if (name != kind_.fields[k].name) continue;
      next_ = k + 1;
      return &values_[k];
    }
    return nullptr;
  }

  static bool is_in(std::string_view group, std::string_view name) {
    return name.size() > group.size() && name[group.size()] == '.' && name.starts_with(group);
  }
  bool is_group(std::string_view name) const {
    const Field* end = kind_.fields + kind_.count;
    return std::any_of(kind_.fields, end, [&](const Field& x) { return is_in(name, x.name); });
  }
  // The largest group around a member that is entirely missing; otherwise the member.
  std::string_view whole_group(std::string_view name) const {
    for (auto dot = name.find('.'); dot != name.npos; dot = name.find('.', dot + 1)) {
      const std::string_view group = name.substr(0, dot);
      bool given = false;
      for (std::int64_t k = 0; k < kind_.count; ++k)
        given |= values_[k].is_valid() && is_in(group, kind_.fields[k].name);
      if (!given) return group;
    }
    return name;
  }

  // "a record of position, velocity"
  std::string members(std::string_view group) const {
    std::string text = "a record of ", last;
    for (std::int64_t k = 0; k < kind_.count; ++k) {
      const std::string_view name = kind_.fields[k].name;
      if (!is_in(group, name)) continue;
      const std::string member(
          name.substr(group.size() + 1, name.find('.', group.size() + 1) - group.size() - 1));
      if (member != last) text += (last.empty() ? "" : ", ") + member;
      last = member;
    }
    return text;
  }

  std::string suggestion(const std::string& name) const {
    nb::list names;
    for (std::int64_t k = 0; k < kind_.count; ++k) {
      const std::string_view full = kind_.fields[k].name;
      for (auto dot = full.find('.'); dot != full.npos; dot = full.find('.', dot + 1))
        if (const auto group = full.substr(0, dot); !is_in(group, name))
          names.append(nb::cast(std::string(group)));
      names.append(nb::cast(std::string(full)));
    }
    const nb::object close =
        nb::module_::import_("difflib").attr("get_close_matches")(name, names, 1);
    if (nb::len(close) == 0) return "; it is " + signature(kind_);
    return "; did you mean " + text_of(close[0]) + "?";
  }

  [[noreturn]] void complain(const std::string& text) const {
    throw nb::type_error((kind_.name + text).c_str());
  }

  const Kind& kind_;
  std::vector<nb::object> values_;
  std::int64_t next_ = 0;
};

}  // namespace

nb::tuple values_of(const Kind& kind, nb::args by_order, nb::kwargs by_name) {
  if (by_order.size())
    throw nb::type_error(
        (std::string(kind.name) + " takes its arguments by name: " + signature(kind)).c_str());
  Given given(kind);
  for (auto [name, value] : by_name) given.add(text_of(name), value);
  return given.all();
}

std::vector<Argument> arguments_of(const Kind& kind, nb::tuple values) {
  std::vector<Argument> found;
  for (std::int64_t k = 0; k < kind.count; ++k)
    found.push_back(argument(kind, kind.fields[k], values[k]));
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

std::string text_of(nb::handle x) {
  const nb::str text(x);
  Py_ssize_t size = 0;
  if (const char* plain = PyUnicode_AsUTF8AndSize(text.ptr(), &size))
    return {plain, std::size_t(size)};
  PyErr_Clear();  // half of a pair of surrogates, which is no character
  return text_of(text.attr("encode")("ascii", "backslashreplace").attr("decode")("ascii"));
}

}  // namespace hsp
