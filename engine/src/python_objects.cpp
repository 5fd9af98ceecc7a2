#include "python_objects.hpp"

#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "numpy.hpp"

namespace nb = nanobind;

namespace hsp {

bool CallObject::runs_python(nb::tuple given) {
  for (nb::handle each : given)
    if (PlanObject::is_python(each)) return true;
  return false;
}

nb::dict named_values(const Kind& kind, nb::tuple values) {
  nb::dict found;
  for (std::int64_t k = 0; k < kind.count; ++k) found[kind.fields[k].name] = values[k];
  return found;
}

bool PlanObject::is_python(nb::handle call) {
  if (nb::isinstance<MoveObject>(call)) return nb::cast<MoveObject&>(call).python;
  return nb::isinstance<Runnable>(call) && nb::cast<Runnable&>(call).python;
}

std::vector<Plan::Row> PlanObject::rows(nb::tuple given) {
  std::vector<Plan::Row> found;
  for (nb::handle each : given) {
    if (nb::isinstance<Runnable>(each)) {
      found.push_back(nb::cast<Runnable&>(each).row);
    } else {  // what was compiled elsewhere says the same addresses
      const auto row = nb::cast<std::pair<std::intptr_t, std::intptr_t>>(each.attr("row"));
      found.push_back({reinterpret_cast<double (*)(void*, double)>(row.first),
                       reinterpret_cast<void*>(row.second)});
    }
  }
  return found;
}

double PythonCall::made(double t) const {
  [[maybe_unused]] const Allocation allocation(true);  // Python may make other calls
  const nb::object value = timed ? function(t) : function();
  PyObject* x = value.ptr();
  const bool number = PyFloat_Check(x) || PyLong_Check(x) || PyArray_CheckScalar(x);
  return number ? PyFloat_AsDouble(x) : 0.0;
}

namespace {

using Strided = Eigen::Map<const Vector, Eigen::Unaligned, Eigen::InnerStride<>>;

// A vector of doubles, whatever its stride; an empty one with a null pointer if it is none.
Strided vector_of(nb::handle given) {
  const auto none = Strided(nullptr, 0, Eigen::InnerStride<>(1));
  if (!PyArray_Check(given.ptr())) return none;
  auto* x = reinterpret_cast<PyArrayObject*>(given.ptr());
  if (PyArray_NDIM(x) != 1 || PyArray_TYPE(x) != NPY_DOUBLE || !PyArray_ISBEHAVED_RO(x))
    return none;
  return Strided(static_cast<const double*>(PyArray_DATA(x)), PyArray_DIM(x, 0),
                 Eigen::InnerStride<>(PyArray_STRIDE(x, 0) / static_cast<Index>(sizeof(double))));
}

}  // namespace

namespace {

template <class T> T attribute(nb::handle object, const char* name) {
  return nb::cast<T>(object.attr(name));
}

Vector3 vector3(nb::handle object) {
  const auto x = nb::cast<std::array<double, 3>>(object);
  return {x[0], x[1], x[2]};
}

Joint joint_of(nb::handle given) {
  Joint joint;
  joint.name = attribute<std::string>(given, "name");
  joint.type = attribute<std::string>(given, "type");
  joint.parent = attribute<std::int64_t>(given, "parent");
  joint.placement = attribute<std::array<double, 12>>(given, "placement");
  joint.axis = vector3(given.attr("axis"));
  joint.pitch = attribute<double>(given, "pitch");
  joint.leader = attribute<std::int64_t>(given, "leader");
  joint.ratio = attribute<double>(given, "ratio");
  joint.offset = attribute<double>(given, "offset");
  for (nb::handle part : given.attr("parts")) joint.parts.push_back(joint_of(part));
  joint.mass = attribute<double>(given, "mass");
  joint.center = vector3(given.attr("center"));
  const auto inertia = attribute<std::array<double, 9>>(given, "inertia");
  joint.inertia = Matrix3(inertia.data());  // symmetric
  return joint;
}

std::vector<Joint> joints_of(nb::tuple given) {
  std::vector<Joint> joints;
  for (nb::handle each : given) joints.push_back(joint_of(each));
  return joints;
}

Vector vector_of(nb::tuple given) {
  const auto x = nb::cast<std::vector<double>>(given);
  return Eigen::Map<const Vector>(x.data(), static_cast<Index>(x.size()));
}

}  // namespace

DynamicsObject::DynamicsObject(nb::tuple joints, nb::tuple gravity, nb::tuple armature)
    : given(nb::make_tuple(joints, gravity, armature)),
      dynamics(joints_of(joints), vector3(gravity), vector_of(armature)) {}

MoveObject::MoveObject(nb::tuple given)
    : values(given),
      call(kind_of<Move>(), arguments_of(kind_of<Move>(), given)),
      python(CallObject::runs_python(given)) {}

std::optional<double> MoveObject::operator()(nb::handle t, nb::handle q, nb::handle v) {
  Move& move = *static_cast<Move*>(call.self());
  const double time = PyFloat_AsDouble(t.ptr());
  if (time == -1.0 && PyErr_Occurred()) {
    PyErr_Clear();
    return std::nullopt;
  }
  const Strided q_in = vector_of(q), v_in = vector_of(v);
  const bool fits = q_in.size() == move.q.size() && v_in.size() == move.v.size();
  return fits ? move.to(time, q_in, v_in) : std::nullopt;
}

}  // namespace hsp
