// A robot's rigid-body dynamics: Pinocchio's algorithms on a model built from parameters.
//
// Only this directory includes Pinocchio. Its algorithms are compiled in, so that any release of
// its Python package can be installed, and so that a step needs no Python. The results of these
// functions do not depend on earlier calls.
#pragma once
#include <array>
#include <hsp/view.hpp>
#include <memory>
#include <string>
#include <vector>

namespace hsp {

using ConstVector = Eigen::Map<const Vector>;
using Jacobian = Eigen::Map<Eigen::Matrix<double, 6, Eigen::Dynamic>>;
using Square = Eigen::Map<Matrix>;
using Inertias = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 9, Eigen::RowMajor>>;
using Centers = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>;
using Placements = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 12, Eigen::RowMajor>>;

// A joint and the body that it moves; in the joint's axes where nothing else is stated.
struct Joint {
  std::string name, type;            // Pinocchio's name of the type: "JointModelRZ"
  std::int64_t parent = 0;           // 0: the world
  std::array<double, 12> placement;  // in the parent: R, row by row, and the origin [m]
  Vector3 axis = Vector3::UnitX();   // for joints that move along or about any axis
  double pitch = 0.0;                // of a screw [m/rad]
  std::int64_t leader = 0;           // the joint it follows: q = ratio q_leader + offset; 0: none
  double ratio = 1.0, offset = 0.0;
  std::vector<Joint> parts;  // of a composite joint: in series, by their placements
  double mass = 0.0;         // of the body [kg]
  Vector3 center = Vector3::Zero();
  Matrix3 inertia = Matrix3::Zero();  // about the centre [kg·m²]
};

// A body that is fixed to a joint, in the joint's axes, and its carried share.
struct Carried {
  std::int64_t joint;
  double mass;                       // [kg]
  Vector3 center;                    // [m]
  Matrix3 inertia;                   // about the centre [kg·m²]
  double share, rate, acceleration;  // the share, and its derivatives [1/s, 1/s²]
};

// Contribution of bodies whose share changes to the motion of the centre of mass c: to c' and c''
// [m/s, m/s²], and to the rate of the angular momentum about c per mass [m²/s²].
struct MassFlow {
  Vector3 velocity = Vector3::Zero(), acceleration = Vector3::Zero(), momentum = Vector3::Zero();
};

const char* pinocchio_version();  // of the compiled code

class Dynamics {
 public:
  static constexpr const char* type_name = "Dynamics";

  // `armature` [kg·m² or kg] is the rotors' part of the diagonal of M, shape (n,).
  // Throws std::invalid_argument for a joint that is not known, or whose parent or leader does
  // not come before it.
  Dynamics(const std::vector<Joint>& joints, const Vector3& gravity, const Vector& armature);
  ~Dynamics();
  Dynamics(const Dynamics&) = delete;

  Index configuration_size() const;  // q's
  Index size() const;                // v's
  Index columns() const;             // of the Jacobian of all joints, followers included
  Index joints() const;              // with the world
  // Whether Pinocchio's algorithms allocate: for planar joints, screws about any axis, and joints in
  // series as one (seen with 4.1).
  bool allocates() const;

  // Set the payloads, in addition to the model's bodies; at most as many as `make_room` reserves.
  void make_room(Index bodies);
  void put_down();
  void carry(const Carried& body);
  void change_gravity(const Vector3& change);  // relative to the model's, in the world [m/s²]
  Vector3 gravity() const;
  double mass() const;  // of all bodies [kg]
  void body_masses(Eigen::Map<Vector> mass, Centers center) const;
  // About the centres, row by row, in the joints' axes.
  void body_inertias(Inertias inertia) const;

  // end ⊖ start: the displacement from one configuration to another.
  void difference(const ConstVector& start, const ConstVector& end,
                  Eigen::Map<Vector> displacement) const;
  // J and J' of all joints in world axes at the world's origin, and the joints' placements: R,
  // column by column, and the origin.
  void joint_jacobians(const ConstVector& q, const ConstVector& v, Jacobian J, Jacobian J_dot,
                       Placements placements);
  void inverse_dynamics(const ConstVector& q, const ConstVector& v, const ConstVector& a,
                        Eigen::Map<Vector> effort);  // RNEA
  void mass_matrix(const ConstVector& q, Square M);  // CRBA
  // Along v, payloads included.
  void mass_matrix_rate(const ConstVector& q, const ConstVector& v, Square M_dot);
  // M⁻¹ (tau - N); false if M is singular.
  bool forward_dynamics(const ConstVector& q, const ConstVector& v, const ConstVector& tau,
                        Eigen::Map<Vector> a);
  // The centroidal map: A v = (momentum, angular momentum about the centre of mass c), and A'
  // about a point at rest, both for constant masses. Returns the contribution of changing masses.
  MassFlow centroidal_map(const ConstVector& q, const ConstVector& v, Vector3& c, Jacobian A,
                          Jacobian A_dot);

 private:
  struct Pinocchio;
  std::unique_ptr<Pinocchio> pinocchio_;
};

}  // namespace hsp
