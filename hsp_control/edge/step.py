"""What the kernels of the law and of its edge read and write in each step."""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.edge.threshold import Following, Thresholds
from hsp_control.law.samples import FieldSample, MetricSample, TaskSample


class Factors(NamedTuple):
    """The two factors of the stack's pseudo-inverse, see `pseudo_inverse.py`."""

    Q: Array  # (m, nv)
    X: Array  # (m, m)


class Projectors(NamedTuple):
    """What `write_damped_levels` leaves of its projectors, where it was needed.

    Level k takes Q_{k-1} J_kᵀ q(G_k) J_k Q_{k-1} of W⁻¹, and leaves Q_k.
    """

    Q: Array  # what the last level leaves, Q_K = P W⁻¹, shape (nv, nv)
    QJ: Array  # Q_{k-1} J_kᵀ of all levels side by side, shape (nv, m)
    G_inverse: Array  # q(G_k) of all levels along the diagonal, shape (m, m)


class EdgeMemory(NamedTuple):
    """What the two laws leave, between the steps of the law."""

    Q: Array  # factors of the exact inverse, see `pseudo_inverse.py`: (m, nv)
    X: Array  # (m, m)
    turned: Array  # scratch, (m, nv)
    exact: Array  # a_exact, shape (nv,), where μ < 1 and the laws differ
    damped: Array  # a_damped, shape (nv,), where they differ or a limit is violated
    by_tasks: Array  # a_damped without φ_N, where it went level by level, shape (nv,)
    exact_e_N: Array  # shape (nv,)
    # φ_N of a and of a_damped, and what brakes them, P K_N P v, shape (2, nv) each;
    # they are written where a limit is violated
    self_motions: Array
    brakings: Array
    share: Array  # μ, without the share of the limits, shape (1,)
    code: Indices  # of a_damped, see `outcome_of`, shape (1,)

    @classmethod
    def allocate(cls, m: int, nv: int) -> Self:
        """Return memory for m rows."""
        return cls(
            Q=np.zeros((m, nv)),
            X=np.zeros((m, m)),
            turned=np.zeros((m, nv)),
            exact=np.zeros(nv),
            damped=np.zeros(nv),
            by_tasks=np.zeros(nv),
            exact_e_N=np.zeros(nv),
            self_motions=np.zeros((2, nv)),
            brakings=np.zeros((2, nv)),
            share=np.zeros(1),
            code=np.zeros(1, dtype=np.int64),
        )


class Scratch(NamedTuple):
    """Memory of the law between its steps."""

    factors: Factors  # the stack's pseudo-inverse
    wide: Array  # (m, nv)
    square: Array  # (3, m, m)
    rows: Array  # (7, max(m, nv))
    tall: Array  # (nv, m); for levels in conflict
    inner: Array  # (nv, nv); for levels in conflict
    edge: EdgeMemory


class LawStep(NamedTuple):
    """What the law's kernels read and write in each step; see `Resolution`."""

    task: TaskSample
    field: FieldSample
    metric: MetricSample
    form: int
    v: Array
    K_N: Array
    threshold: float
    following: Following
    controls: bool
    exact_beside: bool
    alone: bool
    ends: Indices
    asked: Array
    yields: Array
    pulls: Array
    springs: Flags
    stretched: Array
    thresholds: Thresholds
    scratch: Scratch
    e_N: Array
    a: Array
    code: Indices
