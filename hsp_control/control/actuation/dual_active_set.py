"""A dual active-set solver for small, dense, strictly convex QPs, as kernels.

Minimise ½ ‖y‖² over x = x0 + J y, where H⁻¹ = J Jᵀ, subject to

    lower ≤ A x ≤ upper,        the first rows equalities,
    least ≤ x ≤ greatest,       entries may be infinite.

The method is that of Goldfarb and Idnani (1983). It starts at the unconstrained optimum
and adds the most violated constraint, until none is violated. The constraints that it
holds active are kept as B = L Q: row i of B is Jᵀ a_i, Q has orthonormal rows and L is
lower triangular (Gill, Gould, Murray, Saunders and Wright 1984, "A weighted
Gram-Schmidt method for convex quadratic programming"). So J is never changed, and the
zeros of its columns and of A's rows save work in every iteration.

Each constraint that enters raises the dual cost strictly, so no set of active
constraints returns and the method cannot cycle; against rounding there is a limit on
iterations.

A constraint can be *soft*: lower ≤ a·x + s ≤ upper with the cost s²/(2 σ²). Its slack s
is one more entry of y, and σ one more entry of Jᵀ a. A QP whose constraints contradict
each other is solved again with soft ones.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import solve_lower, solve_lower_transposed

SOLVED = 0
"""x is the optimum."""
INFEASIBLE = 1
"""The constraints contradict each other; x and the multipliers are of no use."""
EXHAUSTED = 2
"""The limit on iterations was reached; x and the multipliers are of no use."""

_TOLERANCE = 1e-10
"""Distance from x to a violated constraint that is accepted, relative to 1 + max|x|. It
does not depend on the scale of the row."""
_DEPENDENT = 1e-12
"""A row belongs to the span of the active ones if its remainder in y is smaller than
this, relative to ‖a‖ ‖J‖_F: rounding leaves 1e-15, the cheapest and the dearest motion
of the law differ by 1e4."""
_ITERATIONS = 10
"""Limit on iterations, per constraint. Random QPs need 2 at most (benchmarks/qp.py)."""


class Factor(NamedTuple):
    """J with H⁻¹ = J Jᵀ, by its columns.

    Attributes:
        JT: Jᵀ, shape (nz, n), nz ≤ n: what its rows do not span does not move.
        begin: First non-zero entry of each row, shape (nz,).
        end: After the last non-zero entry of each row, shape (nz,).
    """

    JT: Array
    begin: Indices
    end: Indices


class Constraints(NamedTuple):
    """Rows lower ≤ A x ≤ upper, and bounds on x, which count as rows k, k + 1, ...

    Attributes:
        A: Shape (k, n).
        begin: First non-zero entry of each row, shape (k,).
        end: After the last non-zero entry of each row, shape (k,).
        lower: Lower bounds and then those of x, shape (k + n,).
        upper: Upper bounds and then those of x, shape (k + n,).
        softness: σ of each constraint, shape (k + n,), zero if it is hard; shape (0,)
            if all are.
    """

    A: Array
    begin: Indices
    end: Indices
    lower: Array
    upper: Array
    softness: Array


class Workspace(NamedTuple):
    """The solver's memory; m is the largest number of active constraints.

    Attributes:
        held: For each constraint 1 if its lower bound is active, -1 if the upper, else
            0, shape (k + n,). A warm start begins with what it contains.
        counts: Number of active constraints and of iterations, shape (2,).
        active: The active constraints, shape (m,).
        multipliers: Theirs, in that order, shape (m,): H (x - x0) = Σ multiplier a;
            positive at lower bounds.
        origin: x0, shape (n,).
        norms: ‖a‖ of each constraint, shape (k + n,).
        L: Shape (m, m).
        Q: Shape (m, width).
        vectors: y, a row of B, and its remainder, shape (3, width).
        steps: Two vectors of the active constraints, shape (2, m).
    """

    held: Indices
    counts: Indices
    active: Indices
    multipliers: Array
    origin: Array
    norms: Array
    L: Array
    Q: Array
    vectors: Array
    steps: Array

    @classmethod
    def of(cls, n: int, k: int, soft: bool = False) -> Self:
        """Allocate for n unknowns and k rows; ``soft``: if any constraint may be."""
        width = n + (k + n if soft else 0)
        m = min(width, k + n)
        return cls(
            np.zeros(k + n, dtype=np.int64),
            np.zeros(2, dtype=np.int64),
            np.zeros(m, dtype=np.int64),
            np.zeros(m),
            np.zeros(n),
            np.zeros(k + n),
            np.zeros((m, m)),
            np.zeros((m, width)),
            np.zeros((3, width)),
            np.zeros((2, m)),
        )


@kernel
def minimise(
    factor: Factor,
    constraints: Constraints,
    equalities: int,
    warm: bool,
    x: Array,
    work: Workspace,
) -> int:
    """Overwrite x0 with the optimum x; return `SOLVED`, `INFEASIBLE` or `EXHAUSTED`.

    Args:
        factor: The cost.
        constraints: The constraints.
        equalities: How many of the first rows are equalities (lower = upper).
        warm: Whether to begin with the active constraints of the last call.
        x: x0, shape (n,); overwritten.
        work: Memory; its active constraints, multipliers and counts are results.
    """
    if not _prepare(factor, constraints, equalities, warm, x, work):
        return INFEASIBLE
    reference = _square(factor.JT) * _DEPENDENT * _DEPENDENT
    for i in range(work.held.shape[0]):
        if work.held[i] != 0:
            _append(i, factor, constraints, reference, work)
    _settle(factor, constraints, equalities, x, work)
    settled = True
    while work.counts[1] < _ITERATIONS * work.held.shape[0]:
        entering, violation = _most_violated(factor, constraints, x, work)
        if entering >= 0:
            if not _enter(
                entering, violation, factor, constraints, equalities, reference, work
            ):
                return INFEASIBLE
            _move(factor, work.vectors[0], x, work)
            settled = False
        elif not settled:  # x is a sum of steps: compute it anew, and look again
            _settle(factor, constraints, equalities, x, work)
            settled = True
        else:
            return SOLVED
    return EXHAUSTED


@kernel
def _prepare(
    factor: Factor,
    constraints: Constraints,
    equalities: int,
    warm: bool,
    x: Array,
    work: Workspace,
) -> bool:
    """Begin at x0, mark what to hold; return whether each lower bound is permitted."""
    A, begin, end, lower, upper, _ = constraints
    k, n = A.shape
    held, norms = work.held, work.norms
    work.counts[:] = 0
    work.vectors[0] = 0.0
    largest = 0.0
    for j in range(n):
        work.origin[j] = x[j]
        largest = max(largest, abs(x[j]))
        norms[k + j] = 1.0
    for i in range(k):
        square = 0.0
        for j in range(begin[i], end[i]):
            square += A[i, j] * A[i, j]
        norms[i] = np.sqrt(square) if square > 0.0 else 1.0
    for i in range(k + n):
        if lower[i] - upper[i] > _TOLERANCE * norms[i] * (1.0 + largest):
            return False
        bound = lower[i] if held[i] > 0 else upper[i]
        if i < equalities:
            held[i] = 1
        elif not (warm and np.isfinite(bound)):
            held[i] = 0
    return True


@kernel
def _settle(
    factor: Factor,
    constraints: Constraints,
    equalities: int,
    x: Array,
    work: Workspace,
) -> None:
    """Compute y and the multipliers of the active constraints from x0.

    y = Qᵀ w and Lᵀ multipliers = w with L w = b - A x0. Constraints with a multiplier of
    the wrong sign are released, the worst first: what remains is the optimum of the
    active constraints, where the method may begin.
    """
    y = work.vectors[0]
    while True:
        count = work.counts[0]
        L = work.L[:count, :count]
        w, residual = work.steps[0, :count], work.steps[1, :count]
        y[:] = 0.0
        w[:] = 0.0
        for _ in range(2):  # the second time corrects rounding
            _move(factor, y, x, work)
            for c in range(count):
                i = work.active[c]
                bound = constraints.lower if work.held[i] > 0 else constraints.upper
                residual[c] = bound[i] - _value(i, factor, constraints, x, y)
            solve_lower(L, residual)
            for c in range(count):
                w[c] += residual[c]
                for j in range(y.shape[0]):
                    y[j] += residual[c] * work.Q[c, j]
        solve_lower_transposed(L, w)
        wrong, least = -1, 0.0
        for c in range(count):
            work.multipliers[c] = w[c]
            i = work.active[c]
            if i >= equalities and work.held[i] * w[c] < least:
                wrong, least = c, work.held[i] * w[c]
        if wrong < 0:
            break
        _release(wrong, work)
    _move(factor, y, x, work)


@kernel
def _move(factor: Factor, y: Array, x: Array, work: Workspace) -> None:
    """Write x = x0 + J y."""
    JT, begin, end = factor
    for j in range(x.shape[0]):
        x[j] = work.origin[j]
    for r in range(JT.shape[0]):
        for j in range(begin[r], end[r]):
            x[j] += y[r] * JT[r, j]


@kernel
def _value(i: int, factor: Factor, constraints: Constraints, x: Array, y: Array) -> float:
    """Return a_i·x, and the slack if constraint i is soft."""
    A, begin, end, _, _, softness = constraints
    k = A.shape[0]
    total = 0.0
    if i >= k:
        total = x[i - k]
    else:
        for j in range(begin[i], end[i]):
            total += A[i, j] * x[j]
    if softness.shape[0] > 0:
        total += softness[i] * y[factor.JT.shape[0] + i]
    return total


@kernel
def _most_violated(
    factor: Factor, constraints: Constraints, x: Array, work: Workspace
) -> tuple[int, float]:
    """Return the constraint that x is farthest from, marked as held, and its violation.

    It is -1 if x satisfies all. The distance is the violation divided by the length of
    the row.
    """
    lower, upper = constraints.lower, constraints.upper
    largest = 0.0
    for j in range(x.shape[0]):
        largest = max(largest, abs(x[j]))
    farthest = _TOLERANCE * (1.0 + largest)
    entering, side, violation = -1, 0, 0.0
    for i in range(work.held.shape[0]):
        if work.held[i] != 0:
            continue
        value = _value(i, factor, constraints, x, work.vectors[0])
        below, above = lower[i] - value, value - upper[i]
        beyond = max(below, above)
        if beyond > farthest * work.norms[i]:
            farthest = beyond / work.norms[i]
            entering, side, violation = i, 1 if below > above else -1, beyond
    if entering >= 0:
        work.held[entering] = side
    return entering, violation


@kernel
def _enter(
    entering: int,
    violation: float,
    factor: Factor,
    constraints: Constraints,
    equalities: int,
    reference: float,
    work: Workspace,
) -> bool:
    """Make a violated constraint active; return False if that is impossible.

    Steps 2 and 3 of the method. Its multiplier grows from zero and y moves with it,
    until the constraint holds; an active one whose multiplier vanishes first is released.
    """
    y, remainder = work.vectors[0], work.vectors[2]
    side, multiplier = work.held[entering], 0.0
    _row(entering, factor, constraints, work)
    while True:
        work.counts[1] += 1
        count = work.counts[0]
        square = _remainder(count, work)
        independent = square > reference * work.norms[entering] * work.norms[entering]
        rate = work.steps[1, :count]  # of the multipliers, Lᵀ rate = Q b
        for c in range(count):
            rate[c] = work.steps[0, c]
        solve_lower_transposed(work.L[:count, :count], rate)
        step, leaving = violation / square if independent else np.inf, -1
        for c in range(count):
            i = work.active[c]
            decrease = side * work.held[i] * rate[c]
            if i >= equalities and decrease > 0.0:
                limit = work.held[i] * work.multipliers[c] / decrease
                if limit < step:
                    step, leaving = limit, c
        if not step < np.inf:
            return False
        multiplier += side * step
        for c in range(count):
            work.multipliers[c] -= side * step * rate[c]
        if independent:
            violation -= step * square
            for j in range(y.shape[0]):
                y[j] += side * step * remainder[j]
        if leaving < 0:
            _extend(entering, square, work)
            work.multipliers[count] = multiplier
            return True
        _release(leaving, work)


@kernel
def _append(
    i: int, factor: Factor, constraints: Constraints, reference: float, work: Workspace
) -> None:
    """Make constraint i active if it does not depend on those that are."""
    _row(i, factor, constraints, work)
    square = _remainder(work.counts[0], work)
    if square > reference * work.norms[i] * work.norms[i]:
        _extend(i, square, work)
    else:
        work.held[i] = 0


@kernel
def _row(i: int, factor: Factor, constraints: Constraints, work: Workspace) -> None:
    """Write the row b = Jᵀ a of constraint i, with its softness."""
    A, begin, end, _, _, softness = constraints
    b, (JT, first, last) = work.vectors[1], factor
    nz, k = JT.shape[0], A.shape[0]
    b[:] = 0.0
    for r in range(nz):
        if i < k:
            total = 0.0
            for j in range(max(begin[i], first[r]), min(end[i], last[r])):
                total += JT[r, j] * A[i, j]
            b[r] = total
        else:
            b[r] = JT[r, i - k]
    if softness.shape[0] > 0:
        b[nz + i] = softness[i]


@kernel
def _remainder(count: int, work: Workspace) -> float:
    """Write Q b, and what remains of b without these components; return its square.

    If nine tenths of the length cancel, the components are subtracted a second time
    ("twice is enough", Giraud et al. 2005).
    """
    b, remainder, components = work.vectors[1], work.vectors[2], work.steps[0]
    before = 0.0
    for j in range(b.shape[0]):
        remainder[j] = b[j]
        before += b[j] * b[j]
    components[:count] = 0.0
    after = before
    for _ in range(2):
        for c in range(count):
            q, component = work.Q[c], 0.0
            for j in range(b.shape[0]):
                component += q[j] * remainder[j]
            for j in range(b.shape[0]):
                remainder[j] -= component * q[j]
            components[c] += component
        after = 0.0
        for j in range(b.shape[0]):
            after += remainder[j] * remainder[j]
        if after > 0.01 * before:
            break
    return after


@kernel
def _extend(i: int, square: float, work: Workspace) -> None:
    """Add constraint i to the active ones: one more row of L and of Q."""
    count = work.counts[0]
    size = np.sqrt(square)
    for c in range(count):
        work.L[count, c] = work.steps[0, c]
    work.L[count, count] = size
    for j in range(work.Q.shape[1]):
        work.Q[count, j] = work.vectors[2, j] / size
    work.active[count] = i
    work.counts[0] = count + 1


@kernel
def _release(leaving: int, work: Workspace) -> None:
    """Remove an active constraint: rotations make L lower triangular again."""
    L, Q, count = work.L, work.Q, work.counts[0] - 1
    work.held[work.active[leaving]] = 0
    work.counts[0] = count
    for r in range(leaving, count):
        work.active[r] = work.active[r + 1]
        work.multipliers[r] = work.multipliers[r + 1]
        for c in range(r + 2):
            L[r, c] = L[r + 1, c]
    for r in range(leaving, count):
        size = np.sqrt(L[r, r] * L[r, r] + L[r, r + 1] * L[r, r + 1])
        cosine, sine = L[r, r] / size, L[r, r + 1] / size
        for i in range(r, count):
            a, b = L[i, r], L[i, r + 1]
            L[i, r], L[i, r + 1] = cosine * a + sine * b, cosine * b - sine * a
        for j in range(Q.shape[1]):
            a, b = Q[r, j], Q[r + 1, j]
            Q[r, j], Q[r + 1, j] = cosine * a + sine * b, cosine * b - sine * a


@kernel
def _square(A: Array) -> float:
    """Return ‖A‖²."""
    total = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            total += A[i, j] * A[i, j]
    return total
