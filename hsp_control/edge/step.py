"""The results of the law and its bounds in every step."""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array


class Factors(NamedTuple):
    """The two factors of the stack's pseudo-inverse, B# = Qᵀ X."""

    Q: Array  # (m, nv)
    X: Array  # (m, m)


class ByLevels(NamedTuple):
    """The contributions of the first k levels to the law, for each level k."""

    by_levels: Array  # part of a_damped, and for the last level of a, (levels, nv)
    at_rest: Array  # J# Kp s(e), the command of their errors alone, (levels, nv)
    factors: Factors  # orthonormal rows Q = X J L⁻ᵀ of the stack, X lower triangular


class Projectors(NamedTuple):
    """The projectors of the damped law of several levels.

    Level k subtracts Q_{k-1} J_kᵀ χ(G_k) J_k Q_{k-1} from Q_{k-1}, which gives Q_k.
    """

    Q: Array  # null space of the last level, Q_K = P W⁻¹, shape (nv, nv)
    QJ: Array  # Q_{k-1} J_kᵀ of all levels side by side, shape (nv, m)
    G_inverse: Array  # χ(G_k) of all levels along the diagonal, shape (m, m)

    @classmethod
    def allocate(cls, m: int, nv: int) -> Self:
        """Return memory for m rows."""
        return cls(np.zeros((nv, nv)), np.zeros((nv, m)), np.zeros((m, m)))


class EdgeMemory(NamedTuple):
    """The results of the two laws, between the calls of a step."""

    Q: Array  # factors of the exact inverse, (m, nv)
    X: Array  # (m, m)
    exact: Array  # a_exact, shape (nv,), where μ < 1 and the laws differ
    damped: Array  # a_damped, shape (nv,), where they differ or a limit is violated
    by_tasks: Array  # a_damped without φ_N, if computed level by level, shape (nv,)
    exact_e_N: Array  # shape (nv,)
    share: Array  # μ, without the share of the limits, shape (1,)

    @classmethod
    def allocate(cls, m: int, nv: int) -> Self:
        """Return memory for m rows."""
        return cls(
            Q=np.zeros((m, nv)),
            X=np.zeros((m, m)),
            exact=np.zeros(nv),
            damped=np.zeros(nv),
            by_tasks=np.zeros(nv),
            exact_e_N=np.zeros(nv),
            share=np.zeros(1),
        )
