"""The damped law of several levels: each inverse is bounded as far as it has to be."""

import numpy as np

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import copy
from hsp_control.edge.threshold import (
    Following,
    Thresholds,
    how_held,
    threshold_below,
)
from hsp_control.law.hierarchy import (
    LevelScratch,
    add_level,
    add_null_space,
    close_level,
    invert_metric,
    open_level,
    write_bounded_inverse,
)
from hsp_control.law.samples import FieldSample, MetricSample, TaskSample


@kernel
def write_damped_levels(
    task: TaskSample,
    field: FieldSample,
    metric: MetricSample,
    form: int,
    v: Array,
    K_N: Array,
    least: float,
    following: Following,
    asked: Array,
    yields: Array,
    springs: Flags,
    thresholds: Thresholds,
    controls: bool,
    ends: Indices,
    scratch: LevelScratch,
    e_N: Array,
    by_tasks: Array,
    a: Array,
) -> int:
    """Write e_N and a; return the first level with a damped singular value.

    1 is the highest level; 0: none was damped.

    Args:
        task: All tasks, level after level: J, J' and a_x, m rows.
        field: g and g', shape (nv,) each.
        metric: W, its Cholesky factor L and W', shape (nv, nv) each.
        form: The metric's form.
        v: Velocity, shape (nv,).
        K_N: Null-space gain [1/s], shape (nv, nv).
        least: ε_0.
        following: How the thresholds of levels below a held one follow.
        asked: What the feedback asks for at rest, shape (m,).
        yields: 0 for rows without a bounded error, shape (m,); see `write_thresholds`.
        springs: Whether a row is that of a spring, shape (m,).
        thresholds: From which singular values of each level's whitened Jacobian, in
            the null space of those above, its inverse is bounded; ``own`` is raised
            here below levels that turn or are held.
        controls: False for φ_N = 0.
        ends: Where each level's rows end in the stack.
        scratch: Memory.
        e_N: Null-space error, shape (nv,).
        by_tasks: What the levels make of a, shape (nv,); the rest is φ_N.
        a: Acceleration, shape (nv,).
    """
    J, J_dot, a_x = task.jacobian, task.jacobian_dot, task.acceleration
    Q, QJ, G_inverse = scratch.Q, scratch.QJ, scratch.G_inverse
    square, rows = scratch.square, scratch.rows
    n = v.shape[0]
    damped = 0
    invert_metric(metric.L, Q)
    drawn, pushed, shares = rows[2, :n], rows[1], rows[4]
    for i in range(n):
        a[i] = drawn[i] = 0.0
    start, held, above = 0, 0.0, np.inf
    own, _, scales = thresholds
    for level in range(ends.shape[0]):
        end = ends[level]
        block = slice(start, end)
        G_inv, rest, opposed = G_inverse[block, block], rows[0], rows[3]
        threshold = own[level]
        # What is left for the level to do, and of that f - J a_f, at rest
        turns = False  # contacts do not: they stay where they are
        for k in range(end - start):
            turns = turns or springs[start + k] or yields[start + k] > 0.0
            rest[k], opposed[k] = a_x[start + k], asked[start + k]
            for i in range(n):
                rest[k] -= J_dot[start + k, i] * v[i] + J[start + k, i] * a[i]
                opposed[k] -= J[start + k, i] * drawn[i]
        least_here = threshold_below(
            opposed[: end - start], held, above, level, following, thresholds
        )
        threshold = max(threshold, least_here)
        # What it does with what those above leave
        x, V = pushed, square[1, : end - start, : end - start]
        smallest = open_level(J[block], Q, QJ[:, block], square[0], V, x)
        write_bounded_inverse(V, x, threshold, shares, G_inv)
        add_level(QJ[:, block], G_inv, rest, shares, a)
        add_level(QJ[:, block], G_inv, opposed, shares, drawn)
        # What it leaves to those below, and how much it turns or is held
        own[level] = threshold
        if turns:
            above = min(above, max(np.sqrt(smallest), threshold) / scales[level])
        if smallest < threshold * threshold:
            wanted = lacking = 0.0
            for k in range(start, end):
                if springs[k]:
                    continue
                lack = asked[k]
                for i in range(n):
                    lack -= J[k, i] * drawn[i]
                wanted += asked[k] * asked[k]
                lacking += lack * lack
            held = max(held, how_held(lacking, wanted, least, following))
            if damped == 0:
                damped = level + 1
        close_level(Q, QJ[:, block], G_inv, pushed)
        start = end

    copy(a, by_tasks)
    add_null_space(
        task, field, metric, form, v, K_N, controls, ends, scratch, e_N, a
    )  # fmt: skip
    return damped
