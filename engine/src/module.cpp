// The Python module: kinds, calls and plans, once for all kinds.
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "build.hpp"
#include "functions.hpp"
#include "python_objects.hpp"
#include "rooms.hpp"

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL hsp_engine_numpy
#include <numpy/arrayobject.h>

namespace nb = nanobind;
using namespace nb::literals;
using namespace hsp;

namespace {

std::string described(const CallObject& object) {
  const Kind& kind = object.call.kind;
  std::string text = std::string(kind.name) + "(";
  for (std::int64_t k = 0; k < kind.count; ++k) {
    const Field& field = kind.fields[k];
    text += std::string(k ? ", " : "") + field.name + "=";
    text += field.access == Access::Number   ? text_of(nb::repr(object.values[k]))
            : field.access == Access::Object ? field.object
                                             : "array" + text_of(object.values[k].attr("shape"));
  }
  return text + ")";
}

nb::list names(const Kind& kind, Access one) {
  nb::list found;
  for (std::int64_t k = 0; k < kind.count; ++k)
    if (kind.fields[k].access == one || kind.fields[k].access == Access::InOut)
      found.append(kind.fields[k].name);
  return found;
}

nb::object engine(const char* name) {
  return nb::module_::import_("hsp_control.engine").attr(name);
}

// Python's collector sees what an object owns: a function may lead back to its own plan.

template <class T, auto member> int traverse(PyObject* self, visitproc visit, void* arg) {
#if PY_VERSION_HEX >= 0x03090000
  Py_VISIT(Py_TYPE(self));
#endif
  if (nb::inst_ready(self)) Py_VISIT((nb::inst_ptr<T>(self)->*member).ptr());
  return 0;
}
template <class T, auto member> int clear(PyObject* self) {
  if (nb::inst_ready(self)) (nb::inst_ptr<T>(self)->*member).reset();
  return 0;
}
template <class T, auto member>
PyType_Slot slots[] = {{Py_tp_traverse, reinterpret_cast<void*>(&traverse<T, member>)},
                       {Py_tp_clear, reinterpret_cast<void*>(&clear<T, member>)},
                       {0, nullptr}};

bool has_numpy() { return _import_array() >= 0; }

}  // namespace

NB_MODULE(_engine, m) {
  if (!has_numpy()) throw nb::python_error();
  nb::set_leak_warnings(false);

  nb::class_<Kind>(m, "Kind", "A kind of call: its arguments and its mathematics.")
      .def("__repr__", &signature)
      .def(
          "__call__",
          [](const Kind& kind, nb::args by_order, nb::kwargs by_name) {
            return new CallObject(kind, values_of(kind, by_order, by_name));
          },
          "Return a call with these arguments, by name; a group is a record of its members.")
      .def_prop_ro("doc", [](const Kind& kind) { return kind.doc; })
      .def_prop_ro("name", [](const Kind& kind) { return kind.name; })
      .def_prop_ro("timed", [](const Kind& kind) { return kind.timed; })
      .def_prop_ro("reads", [](const Kind& kind) { return names(kind, Access::In); })
      .def_prop_ro("writes", [](const Kind& kind) { return names(kind, Access::Out); })
      .def("__copy__", [](nb::object kind) { return kind; })
      .def("__deepcopy__", [](nb::object kind, nb::handle) { return kind; })
      .def("__reduce__", [](nb::object kind) { return engine("reduced")(kind); });

  nb::class_<Runnable>(m, "Runnable", "A callable of a plan: f(t) ↦ a number.")
      .def(
          "__call__", [](const Runnable& call, double t) { return call(t); }, "t"_a = 0.0)
      .def_prop_ro(
          "row",
          [](const Runnable& call) {
            return std::pair(reinterpret_cast<std::intptr_t>(call.row.run),
                             reinterpret_cast<std::intptr_t>(call.row.self));
          },
          "The addresses of its function f(self, t) and of self.")
      .def_ro("python", &Runnable::python, "Whether it runs a function of Python.");

  nb::class_<CallObject, Runnable>(
      m, "Call", "A kind with its arguments, whose memory it reads each time it runs.",
      nb::type_slots(slots<CallObject, &CallObject::values>))
      .def("__repr__", &described)
      .def_prop_ro(
          "kind", [](const CallObject& c) -> const Kind& { return c.call.kind; },
          nb::rv_policy::reference)
      .def_prop_ro(
          "values", [](const CallObject& c) { return named_values(c.call.kind, c.values); },
          "The arguments by name, those of groups as in 'out.position'.")
      .def("__reduce__", [](const CallObject& c) {
        return nb::make_tuple(engine("call"),
                              nb::make_tuple(nb::cast(c.call.kind, nb::rv_policy::reference),
                                             named_values(c.call.kind, c.values)));
      });

  nb::class_<PlanObject, Runnable>(m, "Plan", "Calls that run in sequence.",
                                   nb::type_slots(slots<PlanObject, &PlanObject::calls>))
      .def(
          "__init__",
          [](PlanObject* self, nb::iterable calls) { new (self) PlanObject(nb::tuple(calls)); },
          "calls"_a = nb::tuple())
      .def_ro("calls", &PlanObject::calls)
      .def("__repr__",
           [](const PlanObject& plan) {
             std::string text = "Plan:";
             for (nb::handle each : plan.calls) text += "\n  " + text_of(nb::repr(each));
             return text;
           })
      .def("__reduce__", [](const PlanObject& plan) {
        return nb::make_tuple(engine("Plan"), nb::make_tuple(plan.calls));
      });

  nb::class_<PythonCall, Runnable>(m, "PythonCall",
                                   "A function of Python as a call, of the time or of nothing.",
                                   nb::type_slots(slots<PythonCall, &PythonCall::function>))
      .def(nb::init<nb::object, bool>(), "function"_a, "timed"_a = false)
      .def_ro("function", &PythonCall::function)
      .def_ro("timed", &PythonCall::timed)
      .def("__repr__",
           [](const PythonCall& call) {
             return "PythonCall(" + text_of(nb::repr(call.function)) + ")";
           })
      .def("__reduce__", [](const PythonCall& call) {
        return nb::make_tuple(engine("PythonCall"), nb::make_tuple(call.function, call.timed));
      });

  nb::class_<DynamicsObject>(
      m, "Dynamics", "A robot's rigid-body dynamics: Pinocchio's algorithms and their memory.")
      .def(nb::init<nb::tuple, nb::tuple, nb::tuple>(), "joints"_a, "gravity"_a, "armature"_a)
      .def("__reduce__",
           [](const DynamicsObject& d) { return nb::make_tuple(engine("Dynamics"), d.given); });

  nb::class_<MoveObject>(m, "Move", "Copies t, q and v where they are valid, and makes a plan.",
                         nb::type_slots(slots<MoveObject, &MoveObject::values>))
      .def("__init__",
           [](MoveObject* self, nb::args by_order, nb::kwargs by_name) {
             new (self) MoveObject(values_of(kind_of<Move>(), by_order, by_name));
           })
      .def("__call__", &MoveObject::operator(), "t"_a.none(), "q"_a.none(), "v"_a.none())
      .def_prop_ro(
          "values",
          [](const MoveObject& move) { return named_values(kind_of<Move>(), move.values); })
      .def_ro("python", &MoveObject::python)
      .def("__reduce__", [](const MoveObject& move) {
        return nb::make_tuple(
            engine("call"),
            nb::make_tuple(engine("Move"), named_values(kind_of<Move>(), move.values)));
      });
  m.attr("PINOCCHIO") = pinocchio_version();
  m.attr("BUILD") = build_text();

  m.def(
      "load_library",
      [](const std::string& path) {
        nb::list found;
        for (const auto* kinds = library_kinds(path); *kinds; ++kinds)
          found.append(nb::cast(*kinds, nb::rv_policy::reference));
        return found;
      },
      "path"_a);

  nb::list all;
  for (const auto* kinds : rooms())
    for (; *kinds; ++kinds) all.append(nb::cast(*kinds, nb::rv_policy::reference));
  m.attr("kinds") = all;
  bind_functions(m);
}
