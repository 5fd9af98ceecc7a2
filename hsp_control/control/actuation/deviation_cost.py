"""Cost of deviations from the law's acceleration, level by level."""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import (
    add_rows,
    copy,
    multiply,
    orthogonalise_rows,
    orthonormalise_rows,
    solve_lower_transposed,
    squared_norm,
)
from hsp_control.edge import Resolution
from hsp_control.edge.step import Factors, Projectors
from hsp_control.law import IDENTITY
from hsp_control.law.pseudo_inverse import whiten

_LEAST = 1e-6
"""Least cost of null-space deviation relative to the first level. The smaller it is,
the stricter the priorities; at 1e-6 an error of 1e-3 m/s² remains in the task
(docs/limits.md)."""

_LEVEL, _NULL_SPACE, _MOST = 1.0, 0.2, 0.1
"""What is below a level costs this, another level or the null space, for an error of
the robot's size, relative to the level itself, and the most that it costs [-]."""

_LOST = 1e-3
"""Singular value, relative to the threshold, below which rounding decides where a
direction points; the null space has all of it but 2e-6."""


class Directions(NamedTuple):
    """The directions of the law's levels and of the null space, and what they are from.

    The cost of a deviation δ is ½ δᵀH δ with H = Σ ρ_k (Lᵀδ·n_k)², over directions n_k
    that are orthonormal in whitened coordinates Lᵀδ. So H⁻¹ = J Jᵀ, with the columns
    L⁻ᵀ n_k / √ρ_k in J: no matrix is factorised.

    What is below a level costs a small part of what the level itself does, and the more
    of it the larger the level's own error is: priorities are strict where the errors
    are small. With a fixed tiny part, a hand that cannot reach its target would move
    the null space as far as limits permit for the last bit of it, from one bound of the
    efforts to the other between two periods.

    Springs do not come first: what is below a level of springs costs as much as it
    does. Over the mass matrix, their metric, the deviation is then what Gauss's
    principle of least constraint gives: joints that limits hold get the reaction of
    mechanical stops, which does no work, and a spring feeds no oscillation.

    With P_k what the law leaves to the levels below k, P_0 = 1, a level has the share
    P_{k-1} - P_k of all motions, and the null space what remains, P_K. Their costs are
    ρ_k = ρ_N^t_k, t_1 = 0 to t_N = 1, and that of all is

        log H = log ρ_N Σ t_k (P_{k-1} - P_k),      in whitened coordinates

    Away from singularities each share is a projector, and each n_k belongs to one
    level. Near one the law leaves a part of a direction to the levels below, and so it
    does here: H is a continuous function of the law's own projectors.
    """

    jacobian: Array  # Jacobian of all tasks, level after level, shape (m, nv)
    L: Array  # Cholesky factor of the metric, shape (nv, nv)
    form: int  # metric's form
    ends: Indices  # where each level's rows end in the stack
    error: Array  # error e of all tasks, shape (m,)
    springs: Flags  # whether a row is that of a spring, shape (m,)
    size: float  # robot's size [m]
    first: int  # first level that may deviate: 1 below contacts, else 0
    least: float  # least cost of a level relative to the one above it
    # singular value of each level below which a direction belongs to it in part, shape
    # (levels,)
    thresholds: Array
    factors: Factors  # law's pseudo-inverse of the stack
    projectors: Projectors  # what its levels left, where it went level by level
    code: Indices  # outcome of the damped law, see `Resolution.edge`
    wide: Array  # scratch, shape (m, nv)
    square: Array  # scratch, shape (m, m)
    inner: Array  # scratch, shape (3, nv, max(nv, m))
    scratch: Array  # scratch, shape (2, max(nv, m))
    N: Array  # directions n_k as rows, shape (nv, nv)
    kept: Indices  # how many of the first belong to the first level alone, shape (1,)
    root: Array  # 1/√ρ of each, shape (nv,)
    # t_k and 1/√ρ of each level and of the null space, shape (2, levels + 1)
    costs: Array

    @classmethod
    def of(cls, resolution: Resolution, supported: bool, size: float) -> Self:
        """Allocate for a law."""
        J = resolution.problem.task.jacobian
        m, n = J.shape
        every = len(resolution.ends)
        levels = every - supported
        problem, least = resolution.problem, _LEAST ** (1.0 / max(levels, 1))
        return cls(
            J, problem.metric.L, resolution.form, resolution.ends, problem.task.error,
            problem.springs, size, int(supported), least,
            resolution.thresholds, resolution.factors, resolution.projectors,
            resolution.edge.code,
            np.empty((m, n)), np.empty((m, m)),
            np.empty((3, n, max(n, m))), np.empty((2, max(n, m))), np.empty((n, n)),
            np.zeros(1, dtype=np.int64), np.empty(n), np.zeros((2, every + 1)),
        )  # fmt: skip


@kernel
def _write_costs(directions: Directions) -> None:
    """Write t and 1/√ρ of each level and of the null space."""
    ends, costs, e = directions.ends, directions.costs, directions.error
    last, standing = costs.shape[1] - 1, directions.first > 0
    start, exponent = 0, 0.0
    for k in range(last):
        costs[0, k] = exponent
        square, springs = 0.0, True
        for r in range(start, ends[k]):
            square += e[r] * e[r]
            springs = springs and directions.springs[r]
        of_error = _LEVEL if k < last - 1 else _NULL_SPACE
        below = of_error * np.sqrt(square) / directions.size
        if standing:  # whoever stands keeps the balance at any cost
            below = 0.0
        if k >= directions.first and (standing or not springs):
            exponent += np.log(min(max(below, directions.least), _MOST))
        start = ends[k]
    if last <= directions.first:  # nothing but contacts: the null space is cheap
        exponent = np.log(directions.least)
    costs[0, last] = exponent
    for k in range(last + 1):
        costs[1, k] = np.exp(-0.5 * costs[0, k])
        if exponent < 0.0:
            costs[0, k] /= exponent


@kernel
def write_directions_at_once(directions: Directions) -> None:
    """Write the directions of the only level, and then those of the null space.

    It is for a law that is never resolved level by level, see `Resolution.alone`.
    """
    _write_costs(directions)
    if directions.code[0] > 0:
        count = _write_damped_level(directions)
    else:
        count = directions.jacobian.shape[0]
        if not _copied(directions):
            whiten(directions.jacobian, directions.L, directions.form, directions.wide)
            rows = directions.N[:count]
            orthonormalise_rows(directions.wide, rows, directions.square)
        _write_roots(directions, count)
    _complete(directions, count)


@kernel
def write_directions(directions: Directions) -> None:
    """Write the directions of all levels, and then those of the null space."""
    _write_costs(directions)
    first_damped = directions.code[0]
    if first_damped > 0:
        count = _write_levels(directions, first_damped)
    elif _copied(directions):
        count = directions.jacobian.shape[0]
    else:
        count = _write_levels(directions, directions.ends.shape[0])
    _write_roots(directions, count)
    _complete(directions, count)
    if first_damped > 0:
        _write_shared(directions, count)


@kernel
def _write_roots(directions: Directions, count: int) -> None:
    """Write 1/√ρ of directions that each belong to one level."""
    ends, k = directions.ends, 0
    for r in range(count):
        while r >= ends[k]:
            k += 1
        directions.root[r] = directions.costs[1, k]
    directions.kept[0] = min(count, ends[0])


@kernel
def _copied(directions: Directions) -> bool:
    """Copy the law's rows Q = X B, if they are orthonormal and X is lower triangular.

    Both hold unless the law needed the spectrum: then the rows of Q are orthogonal, but
    not of length 1, or X combines each row with those after it.
    """
    Q, X = directions.factors
    found = True
    for r in range(Q.shape[0]):
        found = found and abs(squared_norm(Q[r]) - 1.0) < 1e-12
        for k in range(Q.shape[0] - 1 - r):
            found = found and X[r, Q.shape[0] - 1 - k] == 0.0
        copy(Q[r], directions.N[r])
    return bool(found)


@kernel
def _write_levels(directions: Directions, levels: int) -> int:
    """Write the directions that the first levels have for themselves; return how many.

    The last of them may have singular values below the threshold: these are left out.
    """
    J, ends, N, square = (
        directions.jacobian, directions.ends, directions.N, directions.square
    )  # fmt: skip
    B, n = directions.wide, directions.N.shape[0]
    count = start = 0
    whiten(J, directions.L, directions.form, B)
    for k in range(levels):
        rows = B[start : ends[k]]
        for r in range(rows.shape[0]):
            _project_out(N[:count], rows[r])
        if k < directions.code[0] - 1 or directions.code[0] == 0:
            # No singular value is small: any orthonormal rows will do, at a tenth of
            # the cost.
            orthonormalise_rows(rows, N[count : count + rows.shape[0]], square)
            count += rows.shape[0]
        else:
            orthogonalise_rows(rows, square[:0])
            for r in range(rows.shape[0]):
                size = np.sqrt(squared_norm(rows[r]))
                if size >= directions.thresholds[k] and count < n:
                    for i in range(n):
                        N[count, i] = rows[r, i] / size
                    count += 1
        start = ends[k]
    return int(count)


@kernel
def _write_damped_level(directions: Directions) -> int:
    """Write the directions of the only level, where the law has found its spectrum."""
    # First those that it has for itself. Of a direction with the singular value s below
    # the threshold the null space has the share (1 - s²/threshold²)². Returns how many.
    Q, N, threshold = directions.factors.Q, directions.N, directions.thresholds[0]
    costs, n, count = directions.costs, directions.N.shape[0], 0
    own, free = costs[1, 0], costs[1, costs.shape[1] - 1]
    for partly in range(2):
        for r in range(Q.shape[0]):
            size = np.sqrt(squared_norm(Q[r]))
            if (size < threshold) != (partly == 1) or size <= _LOST * threshold:
                continue
            lost = max(1.0 - (size / threshold) ** 2, 0.0)
            for i in range(n):
                N[count, i] = Q[r, i] / size
            directions.root[count] = own * (free / own) ** (lost * lost)
            count += 1
        if partly == 0:
            directions.kept[0] = count
    return int(count)


@kernel
def _write_shared(directions: Directions, count: int) -> None:
    """Overwrite the directions after the first ones, which levels share."""
    # These are the eigenvectors of T = Σ t_k (P_{k-1} - P_k) + P_K in the rows of N
    # from ``count`` on, and their costs ρ_N^t for the eigenvalues t.
    Q, QJ, G_inverse = directions.projectors
    L, ends, costs = directions.L, directions.ends, directions.costs
    N, n = directions.N[count:], directions.N.shape[0]
    d, last = N.shape[0], costs.shape[1] - 1
    if d == 0:
        return
    F, T, U = (
        directions.inner[0, :d], directions.inner[1, :d], directions.inner[2, :d]
    )  # fmt: skip
    row = directions.scratch[0]
    for r in range(d):  # Lᵀ Q L is what Q is in whitened coordinates
        for i in range(n):
            F[r, i] = N[r, i]
        if directions.form != IDENTITY:
            multiply(L, N[r], F[r, :n])
    for r in range(d):
        multiply(Q, F[r, :n], row[:n])
        for s in range(d):
            total = 0.0
            for i in range(n):
                total += row[i] * F[s, i]
            T[r, s] = total
        for s in range(d, T.shape[1]):
            T[r, s] = 0.0
    start = 0
    for k in range(ends.shape[0]):
        end = ends[k]
        if costs[0, k] > 0.0:
            for r in range(d):
                for p in range(end - start):
                    total = 0.0
                    for i in range(n):
                        total += F[r, i] * QJ[i, start + p]
                    U[r, p] = total
            for r in range(d):
                for p in range(end - start):
                    row[p] = 0.0
                    for q in range(end - start):
                        row[p] += G_inverse[start + p, start + q] * U[r, q]
                for s in range(d):
                    total = 0.0
                    for p in range(end - start):
                        total += row[p] * U[s, p]
                    T[r, s] += costs[0, k] * total
        start = end
    for r in range(d):  # eigenvalues between 1 and 2: their vectors are well defined
        T[r, r] += 1.0
    orthogonalise_rows(T, U)
    for r in range(d):
        t = min(max(np.sqrt(squared_norm(T[r])) - 1.0, 0.0), 1.0)
        directions.root[count + r] = costs[1, last] ** t
        for i in range(n):
            total = 0.0
            for s in range(d):
                total += U[r, s] * N[s, i]
            F[r, i] = total
    for r in range(d):
        copy(F[r, :n], N[r])


@kernel
def _complete(directions: Directions, count: int) -> None:
    """Complete the first directions to an orthonormal basis, with the null space.

    Each new row is what the others leave of the unit vector of which they leave most.
    The components of a unit vector are entries of N. Where less than half of it
    remains, what rounding left is subtracted ("twice is enough", Giraud et al. 2005).
    """
    N, scratch, free = directions.N, directions.scratch, directions.costs[1, -1]
    n = N.shape[0]
    remainders, shares = scratch[0, :n], scratch[1, :n]
    for i in range(n):
        remainders[i] = 1.0
    for k in range(count):
        for i in range(n):
            remainders[i] -= N[k, i] * N[k, i]
    for missing in range(n - count):
        new = count + missing
        directions.root[new] = free
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
def write_inverse_root(
    directions: Directions, first: int, JT: Array, moving: Indices
) -> None:
    """Write Jᵀ, J Jᵀ = H⁻¹, without the levels before the first that may move."""
    # JT has shape (nv, at least nv); how many of its rows these are is ``moving``.
    N, root, L = directions.N, directions.root, directions.L
    n, rows = N.shape[0], 0
    for k in range(directions.kept[0] if first > 0 else 0, n):
        for i in range(n):
            JT[rows, i] = root[k] * N[k, i]
        if directions.form != IDENTITY:
            solve_lower_transposed(L, JT[rows, :n])
        rows += 1
    moving[0] = rows
