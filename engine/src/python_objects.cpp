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

int CallObject::depth_of(nb::tuple given) {
  int most = 0;
  for (nb::handle each : given) {
    if (!nb::inst_check(each) || !nb::inst_ready(each)) continue;
    if (nb::isinstance<MoveObject>(each)) most = std::max(most, nb::cast<MoveObject&>(each).depth);
    if (nb::isinstance<Runnable>(each)) most = std::max(most, nb::cast<Runnable&>(each).depth);
  }
  return most;
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
    std::pair<std::intptr_t, std::intptr_t> row;
    if (nb::isinstance<Runnable>(each) && nb::inst_ready(each)) {
      found.push_back(nb::cast<Runnable&>(each).row);
    } else if (!nb::isinstance<Runnable>(each) && nb::hasattr(each, "row") &&
               nb::try_cast(each.attr("row"), row) && row.first) {
      // Code that was compiled elsewhere lists the same addresses.
      found.push_back({reinterpret_cast<double (*)(void*, double)>(row.first),
                       reinterpret_cast<void*>(row.second)});
    } else {
      throw nb::type_error(("a plan contains calls and objects with a `row` of calls; number " +
                            std::to_string(found.size()) + " is " + text_of(nb::repr(each)))
                               .c_str());
    }
  }
  return found;
}

namespace {

// A real number, of Python or of NumPy, or an array of one without axes.
bool is_number(PyObject* x) {
  if (PyFloat_Check(x) || PyLong_Check(x)) return true;
  if (!PyArray_CheckScalar(x)) return false;
  if (!PyArray_Check(x))
    return PyArray_IsScalar(x, Floating) || PyArray_IsScalar(x, Integer) ||
           PyArray_IsScalar(x, Bool);
  const int type = PyArray_TYPE(reinterpret_cast<PyArrayObject*>(x));
  return PyTypeNum_ISFLOAT(type) || PyTypeNum_ISINTEGER(type) || PyTypeNum_ISBOOL(type);
}

}  // namespace

double PythonCall::made(double t) const {
  [[maybe_unused]] const Allocation allocation(true);  // Python may make other calls
  const nb::object value = timed ? function(t) : function();
  if (!is_number(value.ptr())) return 0.0;
  const double number = PyFloat_AsDouble(value.ptr());
  if (number == -1.0 && PyErr_Occurred()) throw nb::python_error();  // 10**400
  return number;
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

// Throws nb::type_error with the name where an object is none of these.
template <class T> T number_of(nb::handle object, const std::string& name, const char* what) {
  T found;
  if (nb::try_cast(object, found)) return found;
  throw nb::type_error((name + " is " + what + "; got " + text_of(nb::repr(object))).c_str());
}

// The numbers of a joint, which are its attributes.
struct JointNumbers {
  nb::handle joint;
  std::string name;

  template <class T> T get(const char* attribute, const char* what) const {
    return number_of<T>(joint.attr(attribute), "joint " + name + ": " + attribute, what);
  }
  double real(const char* attribute) const { return get<double>(attribute, "a number"); }
  std::int64_t index(const char* attribute) const {
    return get<std::int64_t>(attribute, "a whole number");
  }
  template <std::size_t n> std::array<double, n> row(const char* attribute) const {
    const std::string what = std::to_string(n) + " numbers";
    return get<std::array<double, n>>(attribute, what.c_str());
  }
  Vector3 vector(const char* attribute) const { return Vector3(row<3>(attribute).data()); }
};

constexpr int most_nested = 100;  // composite joints one within another

Joint joint_of(nb::handle given, int nested = 0) {
  const JointNumbers numbers{given, text_of(nb::repr(given.attr("name")))};
  if (nested > most_nested)
    throw std::invalid_argument("joint " + numbers.name + ": composites within composites, " +
                                std::to_string(most_nested) + " deep");
  Joint joint;
  joint.name = numbers.get<std::string>("name", "a text");
  joint.type = numbers.get<std::string>("type", "a text");
  joint.parent = numbers.index("parent");
  joint.placement = numbers.row<12>("placement");
  joint.axis = numbers.vector("axis");
  joint.pitch = numbers.real("pitch");
  joint.leader = numbers.index("leader");
  joint.ratio = numbers.real("ratio");
  joint.offset = numbers.real("offset");
  for (nb::handle part : given.attr("parts")) joint.parts.push_back(joint_of(part, nested + 1));
  joint.mass = numbers.real("mass");
  joint.center = numbers.vector("center");
  joint.inertia = Matrix3(numbers.row<9>("inertia").data());  // symmetric
  return joint;
}

std::vector<Joint> joints_of(nb::tuple given) {
  std::vector<Joint> joints;
  for (nb::handle each : given) joints.push_back(joint_of(each));
  return joints;
}

Vector3 gravity_of(nb::tuple given) {
  return Vector3(number_of<std::array<double, 3>>(given, "gravity", "3 numbers").data());
}

Vector armature_of(nb::tuple given) {
  const auto x = number_of<std::vector<double>>(given, "armature", "numbers");
  return Eigen::Map<const Vector>(x.data(), static_cast<Index>(x.size()));
}

}  // namespace

DynamicsObject::DynamicsObject(nb::tuple joints, nb::tuple gravity, nb::tuple armature)
    : given(nb::make_tuple(joints, gravity, armature)),
      dynamics(joints_of(joints), gravity_of(gravity), armature_of(armature)) {}

MoveObject::MoveObject(nb::tuple given)
    : values(given),
      call(kind_of<Move>(), arguments_of(kind_of<Move>(), given)),
      python(CallObject::runs_python(given)),
      depth(CallObject::depth_of(given)) {}

std::optional<double> MoveObject::operator()(nb::handle t, nb::handle q, nb::handle v) {
  Move& move = *static_cast<Move*>(call.self());
  const double time = PyFloat_AsDouble(t.ptr());
  if (time == -1.0 && PyErr_Occurred()) {
    if (!PyErr_ExceptionMatches(PyExc_Exception)) throw nb::python_error();  // such as Ctrl-C
    PyErr_Clear();
    return std::nullopt;
  }
  const Strided q_in = vector_of(q), v_in = vector_of(v);
  const bool fits = q_in.size() == move.q.size() && v_in.size() == move.v.size();
  return fits ? move.to(time, q_in, v_in) : std::nullopt;
}

}  // namespace hsp
