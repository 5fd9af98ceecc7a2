// Differences of joint positions.
#pragma once
#include <cmath>
#include <hsp/view.hpp>

namespace hsp {

// Write q ⊖ reference of joints with one degree of freedom; continuous ones, whose coordinates
// are (cos, sin), are within ±π. A row of the joints is an index in v, one in q, and how many
// coordinates there are.
template <class Q, class Reference, class Joints, class Out>
void joint_displacements(const Q& q, const Reference& reference, const Joints& single_dof_joints,
                         Out& out) {
  for (Index k = 0; k < single_dof_joints.rows(); ++k) {
    const Index i = single_dof_joints(k, 0), at = single_dof_joints(k, 1);
    if (single_dof_joints(k, 2) == 1) {
      out[i] = q[at] - reference[at];
    } else {
      const double c = q[at], s = q[at + 1], c_ref = reference[at], s_ref = reference[at + 1];
      out[i] = std::atan2(s * c_ref - c * s_ref, c * c_ref + s * s_ref);
    }
  }
}

}  // namespace hsp
