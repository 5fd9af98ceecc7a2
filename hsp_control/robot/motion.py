"""What moves a state: valid numbers, displacements, accelerations, equal steps."""

from collections.abc import Callable
from math import atan2, ceil
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import kernel

REFUSED = -1.0
"""What a move returns if it was refused; kernels' results are not negative."""


class Acceleration(NamedTuple):
    """v' for what some arrays hold when it is computed.

    Attributes:
        compute: Writes `value` for a time [s].
        value: v', shape (nv,) [rad/s² or m/s²]; the next call overwrites it.
        timeless: `compute` without the time, where it does not depend on it; or None.
    """

    compute: Callable[[float], object]
    value: Array
    timeless: Callable[[], object] | None = None


def number_of_steps(duration: float, step: float) -> int:
    """Return the smallest number of equal steps that are not longer than ``step``."""
    return max(1, ceil(duration / step - 1e-9))


@kernel
def copy_valid(
    t: float,
    q_in: Array,
    v_in: Array,
    q: Array,
    v: Array,
    unit_blocks: Indices,
    stamp: Indices,
) -> bool:
    """Copy q and v if they are finite, of the right sizes and norms; return whether."""
    if q_in.shape[0] != q.shape[0] or v_in.shape[0] != v.shape[0]:
        return False
    total = t
    for i in range(q.shape[0]):
        total += q_in[i]
    for i in range(v.shape[0]):
        total += v_in[i]
    ok = np.isfinite(total)
    for k in range(unit_blocks.shape[0]):
        square = 0.0
        for i in range(unit_blocks[k, 0], unit_blocks[k, 0] + unit_blocks[k, 1]):
            square += q_in[i] * q_in[i]
        ok = ok and abs(square - 1.0) < 2e-6
    if ok:
        for i in range(q.shape[0]):
            q[i] = q_in[i]
        for i in range(v.shape[0]):
            v[i] = v_in[i]
        stamp[0] += 1
    return bool(ok)


@kernel
def joint_displacements(
    q: Array, reference: Array, single_dof_joints: Indices, out: Array
) -> None:
    """Write q ⊖ reference for single-dof joints; continuous joints are within ±π."""
    for k in range(single_dof_joints.shape[0]):
        i, at, size = (
            single_dof_joints[k, 0],
            single_dof_joints[k, 1],
            single_dof_joints[k, 2],
        )
        if size == 1:
            out[i] = q[at] - reference[at]
        else:  # (cos, sin)
            c, s, c_ref, s_ref = q[at], q[at + 1], reference[at], reference[at + 1]
            out[i] = atan2(s * c_ref - c * s_ref, c * c_ref + s * s_ref)
