"""What a state accepts: numbers of the right sizes, finite, and of norm 1 where due."""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel

REFUSED = -1.0
"""What a move returns if it was refused; kernels' results are not negative."""


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
    """Copy q and v if they are valid; return whether they are."""
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
