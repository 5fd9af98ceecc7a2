#include "arguments.hpp"

#include <nanobind/stl/string.h>

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
  throw nb::type_error(
      (std::string(kind.name) + ": " + field.name + " " + use_text(field) + "; got " + given)
          .c_str());
}

// The memory of an array, not a copy: a call reads what is there when it is made.
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

// The object of a type; null if it is of another one.
void* shared_object(std::string_view type, nb::handle given) {
  if (type == Plan::type_name && nb::isinstance<PlanObject>(given))
    return &nb::cast<PlanObject&>(given).plan;
  if (type == Move::type_name && nb::isinstance<MoveObject>(given))
    return nb::cast<MoveObject&>(given).call.self();
  if (type == Dynamics::type_name && nb::isinstance<DynamicsObject>(given))
    return &nb::cast<DynamicsObject&>(given).dynamics;
  return nullptr;
}

Argument argument(const Kind& kind, const Field& field, nb::handle given) {
  Argument found;
  if (field.access == Access::Number) {
    if (!nb::try_cast(given, found.number))
      throw nb::type_error((std::string(kind.name) + ": " + field.name + " is a number; got " +
                            text_of(nb::repr(given)))
                               .c_str());
  } else if (field.access == Access::Object) {
    found.data = shared_object(field.object, given);
    if (!found.data) refuse(kind, field, text_of(nb::repr(given)));
  } else {
    found = array(kind, field, given);
  }
  return found;
}

bool ends_with(std::string_view text, std::string_view end) {
  return end.size() <= text.size() && text.substr(text.size() - end.size()) == end;
}

}  // namespace

void Leaves::add(nb::tuple given, const std::string& prefix) {
  const nb::object fields = nb::getattr(given, "_fields", nb::none());
  std::size_t i = 0;
  for (nb::handle each : given) {
    std::string name = prefix;
    if (!fields.is_none()) name += "." + nb::cast<std::string>(fields[i]);
    ++i;
    if (nb::isinstance<nb::tuple>(each)) {
      add(nb::borrow<nb::tuple>(each), name);
    } else {
      values.push_back(nb::borrow(each));
      names.push_back(name);
    }
  }
}

std::vector<Argument> arguments_of(const Kind& kind, nb::tuple given) {
  const Leaves leaves(given);
  if (static_cast<std::int64_t>(leaves.values.size()) != kind.count)
    throw nb::type_error((std::string(kind.name) + " has " + std::to_string(kind.count) +
                          " arguments; got " + std::to_string(leaves.values.size()) + ": " +
                          signature(kind))
                             .c_str());
  std::vector<Argument> found;
  for (std::int64_t k = 0; k < kind.count; ++k) {
    const Field& field = kind.fields[k];
    if (!ends_with(std::string(".") + field.name, leaves.names[k]))
      throw nb::type_error((std::string(kind.name) + ": in the place of " + field.name +
                            " stands a record's " + leaves.names[k].substr(1))
                               .c_str());
    found.push_back(argument(kind, field, leaves.values[k]));
  }
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

std::string text_of(nb::handle x) { return nb::cast<std::string>(nb::str(x)); }

}  // namespace hsp
