"""A dual active-set solver for small, dense, strictly convex QPs: its memory.

Minimise ½ ‖y‖² over x = x0 + J y, where H⁻¹ = J Jᵀ, subject to

    lower ≤ A x ≤ upper,        the first rows equalities,
    least ≤ x ≤ greatest,       entries may be infinite.

The method is that of Goldfarb and Idnani (1983); it is in the engine, see
``engine/qp/dual_active_set.hpp``. A call of it is
``engine.Minimise(problem, iterations, warm, x, work)``, with x0 in x, which it
overwrites by the optimum; it returns `SOLVED`, `INFEASIBLE` or `EXHAUSTED`.
``iterations`` is their limit, per constraint. A warm start begins with the active
constraints of the last call; x does not depend on it, not even in its last bit.

A constraint can be *soft*: lower ≤ a·x + s ≤ upper with the cost s²/(2 σ²). A QP whose
constraints contradict each other is solved again with soft ones: the smaller σ, the
nearer to the least violation. σ of 1e-2 times the dearest motion's entries of J is
safe; at 1e-4 rounding shows where the cheapest motion is 1e4 times cheaper.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Indices

SOLVED = 0
"""x is the optimum."""
INFEASIBLE = 1
"""The constraints contradict each other, or something is NaN; x is of no use."""
EXHAUSTED = 2
"""The limit on iterations was reached, or rounding prevents an answer; x is of no use.
Neither was seen with hard constraints."""


class QP(NamedTuple):
    """A QP with k rows lower ≤ A x ≤ upper; bounds on x count as k, k + 1, ...

    The cost couples the first n₁ unknowns; that of the others is diagonal:
    J is block-diagonal.
    """

    # Jᵀ of the first unknowns, J Jᵀ = H⁻¹, shape (nz, n₁), nz ≤ n₁. Directions that
    # its rows do not span are not used.
    JT: Array
    own: Array  # J of the others, 1/√cost of each, shape (n - n₁,)
    A: Array  # shape (k, n)
    begin: Indices  # first non-zero entry of each row of A, shape (k,)
    end: Indices  # after the last non-zero entry of each row of A, shape (k,)
    lower: Array  # lower bounds of the rows and then those of x, shape (k + n,)
    upper: Array  # upper bounds of the rows and then those of x, shape (k + n,)
    # σ of each constraint, shape (k + n,), zero if it is hard; shape (0,) if all are
    softness: Array
    equalities: int  # how many of the first rows are equalities, lower = upper


class Workspace(NamedTuple):
    """The active constraints; m is the largest number of them."""

    # for each constraint 1 if its lower bound is active, -1 if the upper, else 0, shape
    # (k + n,). A warm start begins with its contents.
    held: Indices
    counts: Indices  # number of active constraints and of iterations, shape (2,)
    active: Indices  # active constraints, shape (m,)
    # Theirs, in that order, shape (m,): H (x - x0) = Σ multiplier a; positive at lower
    # bounds
    multipliers: Array

    @classmethod
    def of(cls, n: int, k: int, soft: bool = False) -> Self:
        """Allocate for n unknowns and k rows; ``soft``: if any constraint may be."""
        m = min(n + (k + n if soft else 0), k + n)
        held, counts, active = (
            np.zeros(size, dtype=np.int64) for size in (k + n, 2, m)
        )
        return cls(held, counts, active, np.zeros(m))
