// The dynamics of a robot as calls.
//
// q (nq) and v (nv) are Pinocchio's; efforts are in N·m or N, accelerations in rad/s² or m/s², M
// in kg·m² or kg. N are the efforts of gravity, Coriolis and centrifugal forces: M a + N = tau.
#pragma once
#include <hsp/indices.hpp>
#include <hsp/records.hpp>
#include <hsp/rotations.hpp>
#include <limits>
#include <stdexcept>
#include <string>

#include "dynamics.hpp"

namespace hsp {

// Throws if q, v or another vector of v's size has a different size.
inline void check_sizes(const Dynamics& robot, Index q, Index v) {
  if (q == robot.configuration_size() && v == robot.size()) return;
  throw std::invalid_argument("q and v have " + std::to_string(q) + " and " + std::to_string(v) +
                              " entries; this robot's have " +
                              std::to_string(robot.configuration_size()) + " and " +
                              std::to_string(robot.size()));
}

// Permits that Pinocchio allocates, for a robot for which it does.
struct PinocchioAllocates : Allocation {
  explicit PinocchioAllocates(const Dynamics& robot) : Allocation(robot.allocates()) {}
};

struct Carry {
  static constexpr const char* doc =
      "Set the bodies carried at a robot's joints, each with a share, in the joints' axes.";
  Shared<Dynamics> dynamics;
  Ints<'k'> joints;
  In<'k'> masses;       // [kg]
  In<'k', 3> centers;   // [m]
  In<'k', 9> inertias;  // about the centre [kg·m²]
  In<'k'> shares, rates, accelerations;

  void check() const {
    check_indices("joints", joints, dynamics->joints(), 1);
    dynamics->make_room(joints.size());
  }
  void operator()() {
    dynamics->put_down();
    for (Index k = 0; k < joints.size(); ++k)
      dynamics->carry({joints[k], masses[k], centers.row(k).transpose(),
                       Eigen::Map<const Matrix3>(inertias.row(k).data()), shares[k], rates[k],
                       accelerations[k]});
  }
};

struct ChangeGravity {
  static constexpr const char* doc = "Set gravity to the robot's own plus a change of it [m/s²].";
  Shared<Dynamics> dynamics;
  In<3> change;

  void operator()() { dynamics->change_gravity(change); }
};

inline void check_joints(Index given, const Dynamics& dynamics) {
  if (given != dynamics.joints())
    throw std::invalid_argument("the robot has " + std::to_string(dynamics.joints()) +
                                " joints, the world included");
}

struct Weights {
  static constexpr const char* doc =
      "The mass at each joint [kg], payloads included, its centre [m], and gravity.";
  Shared<Dynamics> dynamics;
  Out<'j'> mass;
  Out<'j', 3> center;
  Out<3> gravity;

  void check() const { check_joints(mass.size(), *dynamics.object); }
  void operator()() {
    dynamics->body_masses(mass, center);
    gravity = dynamics->gravity();
  }
};

struct BodyInertias {
  static constexpr const char* doc =
      "The body at each joint, payloads included: mass [kg], centre [m] and the inertia about it "
      "[kg·m²], in the joint's axes; and gravity.";
  Shared<Dynamics> dynamics;
  Out<'j'> mass;
  Out<'j', 3> center;
  Out<'j', 9> inertia;
  Out<3> gravity;

  void check() const { check_joints(mass.size(), *dynamics.object); }
  void operator()() {
    dynamics->body_masses(mass, center);
    dynamics->body_inertias(inertia);
    gravity = dynamics->gravity();
  }
};

struct JointJacobians {
  static constexpr const char* doc =
      "J and J' of all joints in world axes at the world's origin, and the joints' placements: R, "
      "column by column, and the origin.";
  Shared<Dynamics> dynamics;
  In<'q'> q;
  In<'n'> v;
  OutColumns<6, 'x'> jacobian, jacobian_dot;
  Out<'j', 12> placements;

  void check() const {
    check_sizes(*dynamics.object, q.size(), v.size());
    if (jacobian.cols() != dynamics->columns() || placements.rows() != dynamics->joints())
      throw std::invalid_argument("the robot has " + std::to_string(dynamics->columns()) +
                                  " columns and " + std::to_string(dynamics->joints()) +
                                  " joints, the world included");
  }
  void operator()() {
    [[maybe_unused]] const PinocchioAllocates permitted(*dynamics.object);
    dynamics->joint_jacobians(q, v, jacobian, jacobian_dot, placements);
  }
};

struct Difference {
  static constexpr const char* doc = "end ⊖ start, the displacement between configurations.";
  Shared<Dynamics> dynamics;
  In<'q'> start, end;
  Out<'n'> displacement;

  void check() const { check_sizes(*dynamics.object, start.size(), displacement.size()); }
  void operator()() { dynamics->difference(start, end, displacement); }
};

struct InverseDynamics {
  static constexpr const char* doc = "The effort M a + N (RNEA).";
  Shared<Dynamics> dynamics;
  In<'q'> q;
  In<'n'> v, acceleration;
  Out<'n'> effort;

  void check() const { check_sizes(*dynamics.object, q.size(), v.size()); }
  void operator()() {
    [[maybe_unused]] const PinocchioAllocates permitted(*dynamics.object);
    dynamics->inverse_dynamics(q, v, acceleration, effort);
  }
};

struct ForwardDynamics {
  static constexpr const char* doc = "The acceleration M⁻¹ (tau - N); NaN where M is singular.";
  Shared<Dynamics> dynamics;
  In<'q'> q;
  In<'n'> v, effort;
  Out<'n'> acceleration;

  void check() const { check_sizes(*dynamics.object, q.size(), v.size()); }
  void operator()() {
    [[maybe_unused]] const PinocchioAllocates permitted(*dynamics.object);
    if (!dynamics->forward_dynamics(q, v, effort, acceleration))
      acceleration.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
};

struct MassMatrix {
  static constexpr const char* doc = "M(q) (CRBA).";
  Shared<Dynamics> dynamics;
  In<'q'> q;
  Out<'n', 'n'> M;

  void check() const { check_sizes(*dynamics.object, q.size(), M.rows()); }
  void operator()() {
    [[maybe_unused]] const PinocchioAllocates permitted(*dynamics.object);
    dynamics->mass_matrix(q, M);
  }
};

struct MassMatrixRate {
  static constexpr const char* doc = "M' along v.";
  Shared<Dynamics> dynamics;
  In<'q'> q;
  In<'n'> v;
  Out<'n', 'n'> M_dot;

  void check() const { check_sizes(*dynamics.object, q.size(), v.size()); }
  void operator()() {
    [[maybe_unused]] const PinocchioAllocates permitted(*dynamics.object);
    dynamics->mass_matrix_rate(q, v, M_dot);
  }
};

// The centroidal map A gives momentum and angular momentum about the centre of mass c, A v.
// Its linear rows are m J, with c' = J v.
//
// Pinocchio's A' is the rate about a point at rest, but c moves: the rate of the angular rows
// about c is A' - m c' × J (checked against finite differences; Pinocchio's product A'v is right
// as it is, since c' × c' = 0).
struct CentroidalMotion {
  static constexpr const char* doc =
      "The centre of mass, its J, J' and velocity, and the angular rows of A with their rate.";
  Shared<Dynamics> dynamics;
  In<'q'> q;
  In<'n'> v;
  Out<3> position, velocity;
  Out<3> own_acceleration, own_momentum;  // see MassFlow
  Out<1> mass;                            // of the whole robot [kg]
  Out<3, 'n'> J, J_dot, angular, angular_dot;
  struct Map : Eigen::Matrix<double, 6, Eigen::Dynamic> {
    void prepare(const Sizes& size) { setZero(6, size('n')); }
  } A, A_dot;

  void check() const { check_sizes(*dynamics.object, q.size(), v.size()); }
  void operator()() {
    [[maybe_unused]] const PinocchioAllocates permitted(*dynamics.object);
    Vector3 c;
    const MassFlow flow =
        dynamics->centroidal_map(q, v, c, {A.data(), 6, A.cols()}, {A_dot.data(), 6, A.cols()});
    position = c;
    mass[0] = dynamics->mass();
    J = A.topRows<3>() / mass[0];
    J_dot = A_dot.topRows<3>() / mass[0];
    const Vector3 u = J.lazyProduct(v);
    velocity = u + flow.velocity;
    own_acceleration = flow.acceleration;
    own_momentum = flow.momentum;
    angular = A.bottomRows<3>();
    angular_dot = A_dot.bottomRows<3>() - skew(u).lazyProduct(A.topRows<3>());
  }
};

}  // namespace hsp
