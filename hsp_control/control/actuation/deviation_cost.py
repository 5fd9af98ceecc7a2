"""Cost of deviations from the law's acceleration, level by level.

The cost of a deviation δ is ½ δᵀH δ with H = Σ ρ_k (Lᵀδ·n_k)², over directions n_k that
are orthonormal in whitened coordinates Lᵀδ. The directions and their costs are in
the engine, see ``engine/qp/deviation_cost.hpp``.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.edge import BoundLaw
from hsp_control.edge.step import Factors, Projectors
from hsp_control.engine.plans import PartCall

_LEAST = 1e-6
"""Least cost of null-space deviation relative to the first level. The smaller it is,
the stricter the priorities; at 1e-6 an error of 1e-3 m/s² remains in the task
(docs/limits.md)."""


class Levels(NamedTuple):
    """The law's levels, as their directions are made of them."""

    jacobian: Array  # Jacobian of all tasks, level after level, shape (m, nv)
    L: Array  # Cholesky factor of the metric, shape (nv, nv)
    form: int  # metric's form
    ends: Indices  # where each level's rows end in the stack
    error: Array  # error e of all tasks, shape (m,)
    springs: Flags  # whether a row is that of a spring, shape (m,)
    size: float  # robot's size [m]
    first: int  # first level that may deviate: 1 below contacts, else 0
    least: float  # least cost of a level relative to the one above it
    held: Array  # minimum costs below each level, see `held_levels`, (levels,)
    # singular value of each level below which a direction belongs to it in part, shape
    # (levels,)
    thresholds: Array
    units: Array
    factors: Factors  # law's pseudo-inverse of the stack
    exact: Factors  # that of the exact law, where μ < 1
    slack: Array  # of the priorities, shape (1,); see `limit_share`
    projectors: Projectors  # of its levels, where it was resolved level by level
    edge_level: Indices  # see `BoundLaw`, shape (1,)
    alone: bool  # see `BoundLaw`

    @classmethod
    def of(
        cls, law: BoundLaw, supported: bool, size: float, held: Array, slack: Array
    ) -> Self:
        """Return a law's levels; ``supported``: the first is that of contacts."""
        levels = len(law.ends) - supported
        problem = law.problem
        return cls(
            problem.task.jacobian,
            problem.metric.L,
            law.form,
            law.ends,
            problem.task.error,
            problem.springs,
            size,
            int(supported),
            _LEAST ** (1.0 / max(levels, 1)),
            held,
            law.thresholds,
            law.units,
            law.factors,
            Factors(law.edge.Q, law.edge.X),
            slack,
            law.projectors,
            law.edge_level,
            law.alone,
        )


class Directions(NamedTuple):
    """Orthonormal directions in whitened coordinates, level after level."""

    N: Array  # directions n_k as rows, shape (nv, nv)
    kept: Indices  # how many of the first belong to the first level alone, shape (1,)
    root: Array  # 1/√ρ of each, shape (nv,)

    @classmethod
    def of(cls, nv: int) -> Self:
        """Allocate."""
        return cls(np.zeros((nv, nv)), np.zeros(1, dtype=np.int64), np.zeros(nv))


def write_directions(levels: Levels, out: Directions) -> PartCall:
    """Return the call that writes the directions of levels and of the null space."""
    return PartCall(engine.Directions, **levels._asdict(), **out._asdict())


def write_inverse_root(
    levels: Levels, directions: Directions, standing: bool, JT: Array, moving: Indices
) -> PartCall:
    """Return the call that writes Jᵀ, J Jᵀ = H⁻¹.

    Args:
        levels: The law's levels.
        directions: Their directions.
        standing: Whether the first level may not deviate.
        JT: Jᵀ, shape (nv, nv).
        moving: How many of its rows these are, shape (1,).
    """
    return PartCall(
        engine.InverseRoot,
        **directions._asdict(),
        L=levels.L,
        form=levels.form,
        standing=standing,
        JT=JT,
        moving=moving,
    )
