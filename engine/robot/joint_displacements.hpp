// q ⊖ reference of joints with one degree of freedom.
#pragma once
#include <cmath>
#include <hsp/indices.hpp>

namespace hsp {

// Throws if rows of joints do not fit these sizes of q and v.
template <class Joints> void check_joint_rows(const Joints& joints, Index q, Index v) {
  check_indices("the joints' indices in v", joints.col(0), v);
  check_indices("the joints' indices in q", joints.col(1), q);
  check_indices("the joints' entries in q", joints.col(2), 3, 1);
  for (Index k = 0; k < joints.rows(); ++k) check_at_least("q", q, joints(k, 1) + joints(k, 2));
}

// Of one joint: `row` is its index in v, its index in q, and the number of its entries in q. A
// continuous joint has two, (cos, sin), and its displacement is within ±π [rad or m].
template <class Q, class Reference, class Row>
double joint_displacement(const Q& q, const Reference& reference, const Row& row) {
  const Index at = row[1];
  if (row[2] == 1) return q[at] - reference[at];
  const double c = q[at], s = q[at + 1], c_ref = reference[at], s_ref = reference[at + 1];
  return std::atan2(s * c_ref - c * s_ref, c * c_ref + s * s_ref);
}

// Of several joints, each at its index in v; the other entries are unchanged.
template <class Q, class Reference, class Joints, class Out>
void joint_displacements(const Q& q, const Reference& reference, const Joints& joints, Out& out) {
  for (Index k = 0; k < joints.rows(); ++k)
    out[joints(k, 0)] = joint_displacement(q, reference, joints.row(k));
}

}  // namespace hsp
