// The model from its parameters.
#include <cmath>
#include <stdexcept>

#include "pinocchio.hpp"

namespace hsp {

namespace {

using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Types = JointTypes<double, 0>;
using AnyJoint = pin::JointModelTpl<double, 0, JointTypes>;

pin::SE3 placement_of(const Joint& joint) {
  const double* x = joint.placement.data();
  return {Eigen::Map<const RowMatrix3>(x), Eigen::Map<const Vector3>(x + 9)};
}

AnyJoint any_joint(const Joint& joint) {
  const Vector3& u = joint.axis;
  const std::string prefix = "JointModel";
  const std::string type = joint.type.starts_with(prefix) ? joint.type.substr(prefix.size()) : "";
  if (type == "RX") return pin::JointModelRevoluteTpl<double, 0, 0>();
  if (type == "RY") return pin::JointModelRevoluteTpl<double, 0, 1>();
  if (type == "RZ") return pin::JointModelRevoluteTpl<double, 0, 2>();
  if (type == "Revolute") return pin::JointModelRevoluteUnalignedTpl<double, 0>(u);
  if (type == "RevoluteUnbounded")
    return pin::JointModelRevoluteUnboundedUnalignedTpl<double, 0>(u);
  if (type == "Prismatic") return pin::JointModelPrismaticUnalignedTpl<double, 0>(u);
  if (type == "Helical") return pin::JointModelHelicalUnalignedTpl<double, 0>(u, joint.pitch);
  if (type == "FreeFlyer") return pin::JointModelFreeFlyerTpl<double, 0>();
  if (type == "Spherical") return pin::JointModelSphericalTpl<double, 0>();
  if (type == "Planar") return pin::JointModelPlanarTpl<double, 0>();
  if (type == "Translation") return pin::JointModelTranslationTpl<double, 0>();
  if (type == "Composite") {
    if (joint.parts.empty())
      throw std::invalid_argument("joint '" + joint.name + "' is a composite without parts");
    Types::JointModelComposite whole(joint.parts.size());
    for (const Joint& part : joint.parts) whole.addJoint(any_joint(part), placement_of(part));
    return whole;
  }
  throw std::invalid_argument("joint '" + joint.name + "' is a " + joint.type +
                              ", which the engine does not have");
}

void check_before(std::int64_t index, std::int64_t own, const Joint& joint, const char* role) {
  if (index < 0 || index >= own)
    throw std::invalid_argument("joint '" + joint.name + "', number " + std::to_string(own) +
                                ": its " + role + " is number " + std::to_string(index) +
                                "; must come before it");
}

// Throws unless all numbers are finite, the axis has the norm 1, no mass is negative, and the
// inertia is symmetric.
void check_numbers(const Joint& joint) {
  const auto wrong = [&](const char* what) {
    return std::invalid_argument("joint '" + joint.name + "': " + what);
  };
  const Eigen::Map<const Eigen::Vector<double, 12>> placement(joint.placement.data());
  if (!placement.allFinite()) throw wrong("its placement is not finite");
  if (!(std::abs(joint.axis.norm() - 1.0) < 1e-6)) throw wrong("its axis does not have norm 1");
  if (!std::isfinite(joint.pitch + joint.ratio + joint.offset))
    throw wrong("its pitch, ratio or offset is not finite");
  if (!(joint.mass >= 0.0 && std::isfinite(joint.mass))) throw wrong("its mass is not 0 or more");
  if (!(joint.center.allFinite() && joint.inertia.allFinite()))
    throw wrong("its centre of mass or its inertia is not finite");
  if (joint.inertia != joint.inertia.transpose()) throw wrong("its inertia is not symmetric");
  for (const Joint& part : joint.parts) check_numbers(part);
}

// Throws unless a joint can follow another: Pinocchio's own message is a compiler's.
template <class AnyJoint>
void check_follower(const Joint& own, const AnyJoint& joint, const AnyJoint& leader) {
  const bool fits = joint.nv() == 1 && leader.nv() == 1 && joint.nq() == leader.nq();
  if (fits && leader.shortname() != "JointModelMimic" && own.type != "JointModelComposite") return;
  throw std::invalid_argument("joint '" + own.name +
                              "' cannot follow: both have one degree of freedom and as many "
                              "coordinates, and its leader follows no joint");
}

using Model = pin::ModelTpl<double, 0, JointTypes>;

Model model_of(const std::vector<Joint>& joints, const Vector3& gravity, const Vector& armature) {
  Model model;
  model.gravity.linear() = gravity;
  for (const Joint& each : joints) {
    const std::int64_t own = model.njoints;
    check_before(each.parent, own, each, "parent");
    check_before(each.leader, own, each, "leader");
    check_numbers(each);
    AnyJoint joint = any_joint(each);
    if (each.leader) {
      const AnyJoint& leader = model.joints[each.leader];
      check_follower(each, joint, leader);
      joint = Types::JointModelMimic(joint, leader, each.ratio, each.offset);
    }
    model.addJoint(each.parent, joint, placement_of(each), each.name);
    model.inertias[own] = spatial_inertia(each.mass, each.center, each.inertia);
  }
  if (!gravity.allFinite() || !armature.allFinite())
    throw std::invalid_argument("gravity or armature is not finite");
  if (armature.size() != model.nv)
    throw std::invalid_argument("armature has " + std::to_string(armature.size()) +
                                " entries; needs " + std::to_string(model.nv));
  model.armature = armature;
  return model;
}

}  // namespace

Dynamics::Dynamics(const std::vector<Joint>& joints, const Vector3& gravity, const Vector& armature)
    : pinocchio_(new Pinocchio(model_of(joints, gravity, armature))) {
  for (const Joint& each : joints)
    pinocchio_->allocates |= each.type == "JointModelPlanar" || each.type == "JointModelHelical" ||
                             each.type == "JointModelComposite";
}

void Dynamics::make_room(Index bodies) {
  pinocchio_->carried.reserve(static_cast<std::size_t>(bodies));
}

void Dynamics::put_down() {
  pinocchio_->model.inertias = pinocchio_->own;
  pinocchio_->carried.clear();
}

void Dynamics::carry(const Carried& body) {
  if (body.share > 0.0)
    pinocchio_->model.inertias[body.joint] +=
        spatial_inertia(body.share * body.mass, body.center, body.share * body.inertia);
  pinocchio_->carried.push_back(body);
}

void Dynamics::change_gravity(const Vector3& change) {
  pinocchio_->model.gravity.linear() = pinocchio_->own_gravity + change;
}

Vector3 Dynamics::gravity() const { return pinocchio_->model.gravity.linear(); }

double Dynamics::mass() const {
  double sum = 0.0;
  for (const auto& body : pinocchio_->model.inertias) sum += body.mass();
  return sum;
}

void Dynamics::body_masses(Eigen::Map<Vector> mass, Centers center) const {
  const auto& bodies = pinocchio_->model.inertias;
  for (Index i = 0; i < mass.size(); ++i) {
    mass[i] = bodies[i].mass();
    center.row(i) = bodies[i].lever().transpose();
  }
}

void Dynamics::body_inertias(Inertias inertia) const {
  const auto& bodies = pinocchio_->model.inertias;
  for (Index i = 0; i < inertia.rows(); ++i)
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(inertia.row(i).data()) =
        bodies[i].inertia().matrix();
}

const char* pinocchio_version() { return PINOCCHIO_VERSION; }

Dynamics::~Dynamics() = default;
Index Dynamics::configuration_size() const { return pinocchio_->model.nq; }
Index Dynamics::size() const { return pinocchio_->model.nv; }
Index Dynamics::columns() const { return pinocchio_->model.nvExtended; }
Index Dynamics::joints() const { return pinocchio_->model.njoints; }
bool Dynamics::allocates() const { return pinocchio_->allocates; }

}  // namespace hsp
