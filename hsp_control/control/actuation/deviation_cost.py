"""Cost of deviations from the law's acceleration; bound on their null-space part."""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import (
    add_rows,
    copy,
    multiply,
    orthogonalise_rows,
    orthonormalise_rows,
    solve_lower_transposed,
    solve_rows,
    squared_norm,
)
from hsp_control.law import Resolution
from hsp_control.law.pseudo_inverse import whiten
from hsp_control.law.resolution import Factors
from hsp_control.null_space.metrics.metric import IDENTITY

_ONE_LEVEL, _SEVERAL_LEVELS = 1e-6, 1e-8
"""Cost of null-space deviation relative to the first level: two values, for one level
and for several. The smaller it is, the stricter the priorities; at 1e-6 an error of
1e-3 m/s² remains in the task (docs/limits.md)."""

_SHARE = 0.05
"""What the null space may cost where tasks must miss, of what the tasks cost [-]."""

_LOST = 1e-3
"""Singular value, relative to the threshold, below which rounding decides where a
direction points; the null space has all of it but 2e-6."""


class Directions(NamedTuple):
    """The directions of the law's levels and of the null space, and what they are from.

    The cost of a deviation δ is ½ δᵀH δ with H = Σ ρ_k (Lᵀδ·n_k)², over directions n_k
    that are orthonormal in whitened coordinates Lᵀδ. So H⁻¹ = J Jᵀ, with the columns
    L⁻ᵀ n_k / √ρ_k in J: no matrix is factorised.

    Attributes:
        jacobian: Jacobian of all tasks, level after level, shape (m, nv).
        L: Cholesky factor of the metric, shape (nv, nv).
        form: The metric's form.
        ends: Where each level's rows end in the stack.
        threshold: Singular value below which a direction belongs to no level, or for
            the last level only in part.
        wide: Scratch, shape (2, m, nv).
        square: Scratch, shape (m, m).
        remainders: Scratch, shape (nv,).
        shares: Scratch, shape (nv,).
        factors: The law's pseudo-inverse of the stack.
        code: The law's outcome, see `Resolution.code`.
        N: The directions n_k as rows, shape (nv, nv).
        level: The level of each, the number of levels for the null space, shape (nv,).
        share: How much of each the null space has: 0 for a level's own, 1 for its own,
            shape (nv,).
        roots: 1/√ρ of each level and of the null space.
    """

    jacobian: Array
    L: Array
    form: int
    ends: Indices
    threshold: float
    wide: Array
    square: Array
    remainders: Array
    shares: Array
    factors: Factors
    code: Indices
    N: Array
    level: Indices
    share: Array
    roots: Array

    @classmethod
    def of(
        cls, resolution: Resolution, supported: bool, weight: float | None = None
    ) -> Self:
        """Allocate for a law.

        Args:
            resolution: The law, with its levels and its metric.
            supported: Whether the first level is that of the contacts; it costs as much
                as the one below, where it may move at all.
            weight: Cost of null-space deviation relative to the first level; None: the
                default, `_ONE_LEVEL` or `_SEVERAL_LEVELS`.
        """
        J = resolution.problem.task.jacobian
        m, n = J.shape
        every = len(resolution.ends)
        levels = every - supported
        whole = weight or (_ONE_LEVEL if levels <= 1 else _SEVERAL_LEVELS)
        steps = np.maximum(np.arange(every + 1) - supported, 0) / max(levels, 1)
        steps[-1] = 1.0
        return cls(
            J,
            resolution.problem.metric.L,
            resolution.form,
            resolution.ends,
            resolution.threshold,
            np.empty((2, m, n)),
            np.empty((m, m)),
            np.empty(n),
            np.empty(n),
            resolution.factors,
            resolution.code,
            np.empty((n, n)),
            np.empty(n, dtype=np.int64),
            np.empty(n),
            whole ** (-0.5 * steps),
        )


@kernel
def write_directions(directions: Directions) -> None:
    """Write the directions of all levels, and then those of the null space.

    Where no singular value is small, the law has made the rows of all levels
    orthonormal, one after the other; else they are found here.
    """
    Q, N, ends = directions.factors.Q, directions.N, directions.ends
    level, share = directions.level, directions.share
    n, levels = N.shape[0], ends.shape[0]
    if directions.code[0] == 0 and _orthonormalised(directions.factors):
        count, k = Q.shape[0], 0
        for r in range(count):
            copy(Q[r], N[r])
            while r >= ends[k]:
                k += 1
            level[r], share[r] = k, 0.0
    else:
        count = _write_levels(directions)
    _complete(N, count, directions.remainders, directions.shares)
    for r in range(n - count):
        level[n - 1 - r], share[n - 1 - r] = levels, 1.0


@kernel
def _orthonormalised(factors: Factors) -> bool:
    """Return whether Q = X B has orthonormal rows, and X is lower triangular.

    Both hold unless the law needed the spectrum: then the rows of Q are orthogonal, but
    not of length 1, or X combines each row with those after it.
    """
    Q, X = factors
    found = True
    for r in range(Q.shape[0]):
        found = found and abs(squared_norm(Q[r]) - 1.0) < 1e-12
        for k in range(Q.shape[0] - 1 - r):
            found = found and X[r, Q.shape[0] - 1 - k] == 0.0
    return bool(found)


@kernel
def _write_levels(directions: Directions) -> int:
    """Write the directions of all levels, and return their number.

    Below the threshold the law's inverse is bounded: of a direction with the singular
    value s, the projector on the null space has the share (1 - s²/threshold²)². A
    direction of the last level belongs to the null space in that share, so that no
    effort jumps where s passes the threshold. One of a level above others belongs to it
    or not: what it lacks, the levels below may use.
    """
    J, L, form, ends = (
        directions.jacobian, directions.L, directions.form, directions.ends
    )  # fmt: skip
    threshold, wide, square = directions.threshold, directions.wide, directions.square
    N, level, share = directions.N, directions.level, directions.share
    n = N.shape[0]
    count = start = 0
    whiten(J, L, form, wide[0])
    for k in range(ends.shape[0]):
        end = ends[k]
        B, Q = wide[0, start:end], wide[1, start:end]
        for r in range(end - start):
            _project_out(N[:count], B[r])
        # If no singular value is small, any orthonormal rows will do, at a tenth of the
        # cost.
        regular = orthonormalise_rows(B, Q, square) >= threshold
        if not regular:
            orthogonalise_rows(B, square[:0])
        for r in range(end - start):
            size = 1.0 if regular else np.sqrt(squared_norm(B[r]))
            least = _LOST * threshold if k == ends.shape[0] - 1 else threshold
            if count == n or not (regular or size > least):
                continue
            lost = 0.0 if regular else max(1.0 - (size / threshold) ** 2, 0.0)
            share[count] = lost * lost
            for i in range(n):
                N[count, i] = Q[r, i] if regular else B[r, i] / size
            level[count] = k
            count += 1
        start = end
    return int(count)


@kernel
def _complete(N: Array, count: int, remainders: Array, shares: Array) -> None:
    """Complete the first rows of N to an orthonormal basis.

    Each new row is what the others leave of the unit vector of which they leave most.
    The components of a unit vector are entries of N. Where less than half of it
    remains, what rounding left is subtracted ("twice is enough", Giraud et al. 2005).
    """
    n = N.shape[0]
    for i in range(n):
        remainders[i] = 1.0
    for k in range(count):
        for i in range(n):
            remainders[i] -= N[k, i] * N[k, i]
    for missing in range(n - count):
        new = count + missing
        best = 0
        for i in range(n):
            if remainders[i] > remainders[best]:
                best = i
        row, share = N[new], shares[:new]
        for k in range(new):
            share[k] = -N[k, best]
        for i in range(n):
            row[i] = 0.0
        row[best] = 1.0
        add_rows(share, N, row)
        square = squared_norm(row)
        if square < 0.5:
            multiply(N[:new], row, share)
            for k in range(new):
                share[k] = -share[k]
            add_rows(share, N, row)
            square = squared_norm(row)
        size = np.sqrt(square)
        for i in range(n):
            row[i] /= size
            remainders[i] -= row[i] * row[i]


@kernel
def _project_out(N: Array, x: Array) -> None:
    """Subtract from x its components along orthonormal rows."""
    for k in range(N.shape[0]):
        share = 0.0
        for i in range(x.shape[0]):
            share += N[k, i] * x[i]
        for i in range(x.shape[0]):
            x[i] -= share * N[k, i]


@kernel
def write_inverse_root(directions: Directions, first: int, JT: Array) -> int:
    """Write Jᵀ, J Jᵀ = H⁻¹, without the levels before the first that may move.

    Args:
        directions: The directions, which `write_directions` wrote.
        first: The first level that may move.
        JT: Written: Jᵀ, shape (nv, at least nv).

    Returns:
        The number of its rows.
    """
    N, level, L = directions.N, directions.level, directions.L
    n, rows = N.shape[0], 0
    for k in range(n):
        if level[k] < first:
            continue
        root = _root(directions, k)
        for i in range(n):
            JT[rows, i] = root * N[k, i]
        if directions.form != IDENTITY:
            solve_lower_transposed(L, JT[rows, :n])
        rows += 1
    return rows


@kernel
def _root(directions: Directions, k: int) -> float:
    """Return 1/√ρ of a direction: between its level's and the null space's."""
    roots, share = directions.roots, directions.share[k]
    own, free = roots[directions.level[k]], roots[roots.shape[0] - 1]
    if 0.0 < share < 1.0:
        return float(own * (free / own) ** share)
    return float(own)  # of the null space, that is its own


@kernel
def freedom(directions: Directions, k: int) -> float:
    """Return how much of a direction is the null space's by its cost, in [0, 1].

    It is the share times what the null space costs of what the direction costs. In
    half a share that is a thousandth: such a direction is a task's. If it counted as
    free by its share alone, the null space, which has no other task, would jump by
    100 rad/s² for a part in 300 of this one.
    """
    roots, share = directions.roots, directions.share[k]
    if share == 0.0:
        return 0.0
    return float(share * (_root(directions, k) / roots[roots.shape[0] - 1]) ** 2)


@kernel
def null_space_scale(directions: Directions, y: Array) -> float:
    """Return by how much 1/√ρ of the null space shrinks after a first optimum.

    Where limits let no motion keep the tasks, an optimum with a tiny ρ moves the null
    space as far as it can for the last bit of a task: from one bound of the efforts to
    the other between two periods. So the optimum is computed again, with ρ such that
    the null space costs the share `_SHARE` of what the tasks cost, D². Since

        D² + ρ N² ≤ D₁² + ρ N₁²      with ρ N₁² = share D₁²

    the tasks then miss by (1 + share)^½ of the least that they must, at most. Where
    they need not miss, D₁ = 0 and nothing changes. A direction that belongs to both in
    part counts as the null space's by `freedom`.

    Args:
        directions: The directions.
        y: The first optimum δ = J y in terms of `write_inverse_root`, shape (count,).
    """
    roots, missed, moved = directions.roots, 0.0, 0.0
    without = directions.share.shape[0] - y.shape[0]  # those that may not move
    for r in range(y.shape[0]):
        k = without + r
        free, root = freedom(directions, k), _root(directions, k)
        missed += (1.0 - free) * y[r] * y[r]
        moved += free * root * root * y[r] * y[r]
    weight = roots[roots.shape[0] - 1] ** -2.0
    if _SHARE * missed <= weight * moved or moved == 0.0:
        return 1.0
    return float(np.sqrt(weight / min(_SHARE * missed / moved, 1.0)))


@kernel
def write_null_space_rows(directions: Directions, A: Array) -> None:
    """Write P, the projector on the null space of all tasks, into A (nv, at least nv).

    e_N' = -K_N e_N - P δ, up to terms that the law's correction cancels, so that
    d/dt ‖e_N‖_W ≤ -λ ‖e_N‖_W + ‖P δ‖_W: rows |(P δ)_j| ≤ λ s_j keep e_N bounded, and
    δ = 0 always satisfies them. With m the columns of L⁻ᵀ N, P = Σ s_k m_k (L n_k)ᵀ
    with the shares s_k of the null space: the law's own projector.
    """
    L, form, raised = directions.L, directions.form, directions.remainders
    N, share = directions.N, directions.share
    n = N.shape[0]
    for i in range(n):
        for j in range(n):
            A[i, j] = 0.0
    for k in range(n):
        if share[k] == 0.0:
            continue
        for i in range(n):
            raised[i] = share[k] * N[k, i]
        if form != IDENTITY:
            solve_lower_transposed(L, raised)
        for j in range(n):
            lowered = N[k, j]
            if form != IDENTITY:
                lowered = 0.0
                for i in range(j + 1):
                    lowered += L[j, i] * N[k, i]
            for i in range(n):
                A[i, j] += raised[i] * lowered


class DecayRate:
    """λ, the slowest rate at which ‖e_N‖_W decays [1/s], W = L Lᵀ.

    With one number for all degrees of freedom it is that number, whatever the metric:
    then it is found once for a gain, and not in each step.
    """

    def __init__(self) -> None:
        """Begin without a gain."""
        self._known = b""
        self._number: float | None = None

    def of(self, gain: Array, L: Array) -> float:
        """Return λ.

        Args:
            gain: K_N, shape (nv, nv) [1/s].
            L: Cholesky factor of the metric, shape (nv, nv).
        """
        written = gain.tobytes()
        if written != self._known:
            first = float(gain[0, 0])
            alike = (gain == first * np.eye(len(gain))).all()
            self._known, self._number = written, first if alike else None
        return _least_rate(gain, L) if self._number is None else self._number


def _least_rate(gain: Array, L: Array) -> float:
    """Return the largest λ with xᵀW K_N x ≥ λ xᵀW x."""
    lowered = L @ (L.T @ gain)
    both = 0.5 * (lowered + lowered.T)
    for _ in range(2):  # L⁻¹ from the left, then from the right
        both = both.T.copy()
        solve_rows(L, both)
    return float(np.linalg.eigvalsh(both)[0])
