// The rate of the mass matrix; the centre of mass, and the angular momentum about it.
#pragma once
#include <hsp/records.hpp>
#include <hsp/rotations.hpp>

namespace hsp {

struct Clear {
  static constexpr const char* doc = "Write zeros into what Pinocchio adds to or reads.";
  InOutColumns<'r', 'c'> matrix;

  void operator()() { matrix.setZero(); }
};

struct InertiaRate {
  static constexpr const char* doc = "M' = C + Cᵀ, with Coriolis' matrix C.";
  Columns<'n', 'n'> C;
  Out<'n', 'n'> M_dot;

  void operator()() { M_dot = C + C.transpose(); }
};

// The centroidal map A gives momentum and angular momentum about the centre of mass c, A v.
// Its linear rows are m J, with c' = J v.
//
// Pinocchio's A' is the rate about a point at rest, but c moves: the rate of the angular rows
// about c is A' - m c' × J (checked against finite differences; Pinocchio's product A'v is right
// as it is, since c' × c' = 0).
struct CentroidalRows {
  static constexpr const char* doc =
      "J and J' of the centre of mass, its velocity, and the angular rows of A with their rate.";
  Columns<6, 'n'> A, A_dot;
  double mass;
  In<'n'> v;
  Out<3> velocity;
  Out<3, 'n'> J, J_dot, angular, angular_dot;

  void operator()() {
    J = A.topRows<3>() / mass;
    J_dot = A_dot.topRows<3>() / mass;
    velocity = J.lazyProduct(v);
    angular = A.bottomRows<3>();
    angular_dot = A_dot.bottomRows<3>() - skew(velocity).lazyProduct(A.topRows<3>());
  }
};

}  // namespace hsp
