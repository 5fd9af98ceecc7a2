"""A dual active-set solver for small, dense, strictly convex QPs, as kernels.

Minimise ½ ‖y‖² over x = x0 + J y, where H⁻¹ = J Jᵀ, subject to

    lower ≤ A x ≤ upper,        the first rows equalities,
    least ≤ x ≤ greatest,       entries may be infinite.

The method is that of Goldfarb and Idnani (1983). It starts at the unconstrained optimum
and adds the most violated constraint, until none is violated. The constraints that it
holds active are kept as B = L Q: row i of B is Jᵀ a_i, Q has orthonormal rows and L is
lower triangular (Gill, Gould, Murray, Saunders and Wright 1984, "A weighted
Gram-Schmidt method for convex quadratic programming"). So J is never changed, and its
zeros and those of A's rows save work in every iteration.

The loops begin at zero, over slices where need be: an index that may be negative in
Numba's eyes would keep them from being vectorised, which makes them seven times slower.

Each constraint that enters raises the dual cost strictly, so no set of active
constraints returns and the method cannot cycle; against rounding there is a limit on
iterations.

A constraint can be *soft*: lower ≤ a·x + s ≤ upper with the cost s²/(2 σ²). Its slack s
is one more entry of y, and σ one more entry of Jᵀ a. A QP whose constraints contradict
each other is solved again with soft ones: the smaller σ, the nearer to the least
violation. σ of 1e-2 times the dearest motion's entries of J is safe; at 1e-4 rounding
shows where the cheapest motion is 1e4 times cheaper.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import (
    add_rows,
    copy,
    multiply,
    solve_lower,
    solve_lower_transposed,
    squared_norm,
)

SOLVED = 0
"""x is the optimum."""
INFEASIBLE = 1
"""The constraints contradict each other, or something is NaN; x is of no use."""
EXHAUSTED = 2
"""The limit on iterations was reached, or rounding prevents an answer; x is of no use.
Neither was seen with hard constraints."""

_TOLERANCE, _LOOSEST = 1e-10, 1e-6
"""Distance from x to a violated constraint that is accepted, relative to 1 + max|x|. It
does not depend on the scale of the row. It grows tenfold each time that x, computed
anew, violates a constraint: where active rows nearly depend on each other, rounding can
let two of them take turns. What is not solved below the loosest is given up."""
_DEPENDENT = 1e-12
"""A row belongs to the span of the active ones if its remainder in y is smaller than
this, relative to ‖a‖ ‖J‖_F: rounding leaves 1e-15, the cheapest and the dearest motion
of the law differ by 1e4."""
_ITERATIONS = 10
"""Limit on iterations, per constraint. Random QPs need 3 at most, see
benchmarks/qp.py; Talos with all efforts at their limits 5."""


class QP(NamedTuple):
    """A QP with k rows lower ≤ A x ≤ upper; bounds on x count as k, k + 1, ...

    The cost couples the first n₁ unknowns; of the others, each has a cost of its own:
    J is block-diagonal.
    """

    # Jᵀ of the first unknowns, J Jᵀ = H⁻¹, shape (nz, n₁), nz ≤ n₁. What its rows do
    # not span does not move.
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
    """The solver's memory; m is the largest number of active constraints."""

    # for each constraint 1 if its lower bound is active, -1 if the upper, else 0, shape
    # (k + n,). A warm start begins with what it contains.
    held: Indices
    counts: Indices  # number of active constraints and of iterations, shape (2,)
    active: Indices  # active constraints, shape (m,)
    # Theirs, in that order, shape (m,): H (x - x0) = Σ multiplier a; positive at lower
    # bounds
    multipliers: Array
    origin: Array  # x0, shape (n,)
    # square of a remainder of Jᵀ a that is rounding, for a of length 1, shape (1,)
    rounding: Array
    # its active rows, and then that of an entering constraint, shape (m + 1, width)
    B: Array
    L: Array  # shape (m, m)
    Q: Array  # shape (m, width)
    vectors: Array  # y, and the remainder of a row of B, shape (2, width)
    steps: Array  # three vectors of the active constraints, shape (3, m)

    @classmethod
    def of(cls, n: int, k: int, soft: bool = False) -> Self:
        """Allocate for n unknowns and k rows; ``soft``: if any constraint may be."""
        entries = n + (k + n if soft else 0)
        m = min(entries, k + n)
        width = -(-entries // 8) * 8  # whole registers: a tenth faster
        return cls(
            np.zeros(k + n, dtype=np.int64),
            np.zeros(2, dtype=np.int64),
            np.zeros(m, dtype=np.int64),
            np.zeros(m),
            np.zeros(n),
            np.zeros(1),
            np.zeros((m + 1, width)),
            np.zeros((m, m)),
            np.zeros((m, width)),
            np.zeros((2, width)),
            np.zeros((3, m)),
        )


@kernel
def minimise(problem: QP, warm: bool, x: Array, work: Workspace) -> int:
    """Overwrite x0 with the optimum x; return `SOLVED`, `INFEASIBLE` or `EXHAUSTED`.

    The last thing computed is the optimum of the active constraints in their order, so
    that x does not depend on the way there, not even in its last bit: a step is the
    same whether it began with the active constraints of the last one or not.

    A warm start begins with the active constraints of the last call.
    """
    if not _prepare(problem, warm, x, work):
        return INFEASIBLE
    in_order = settled = _begin(problem, x, work)
    tolerance = _TOLERANCE
    limit = _ITERATIONS * work.held.shape[0]
    while work.counts[1] < limit and tolerance < _LOOSEST:
        entering, violation = _most_violated(tolerance, problem, x, work)
        if entering >= 0:
            if settled and work.counts[1] > 0:
                tolerance *= 10.0
            if not _enter(entering, violation, problem, work):
                return INFEASIBLE
            _move(problem, x, work)
            in_order = settled = False
        elif in_order:
            return SOLVED
        else:  # x is a sum of steps: compute it anew, and look again
            in_order = _begin(problem, x, work)
            settled = True
    return EXHAUSTED


@kernel
def _begin(problem: QP, x: Array, work: Workspace) -> bool:
    """Hold the marked constraints, in their order, and make x their optimum."""
    # Not all can be held where one depends on others, or has the wrong sign: False.
    count = 0
    work.counts[0] = 0
    for i in range(work.held.shape[0]):
        if work.held[i] != 0:
            count += 1
            square = _remainder(i, problem, work)
            if square > _negligible(i, problem, work):
                work.multipliers[work.counts[0]] = 0.0
                _extend(i, square, work)
            else:
                work.held[i] = 0
    if count > 0:
        _settle(problem, x, work)
    return bool(work.counts[0] == count)


@kernel
def _prepare(problem: QP, warm: bool, x: Array, work: Workspace) -> bool:
    """Begin at x0, mark what to hold; return whether each constraint can be kept alone.

    NaN makes each comparison false, and so the result. NaN in A is found by
    `_most_violated`.
    """
    lower, upper, held = problem.lower, problem.upper, work.held
    work.counts[:] = 0
    work.vectors[0] = 0.0
    size = 1.0
    copy(x, work.origin)
    for j in range(x.shape[0]):
        size += abs(x[j])
    JT = problem.JT
    rounding = squared_norm(problem.own) + squared_norm(JT.reshape(JT.size))
    work.rounding[0] = _DEPENDENT * _DEPENDENT * rounding
    possible = size + rounding < np.inf
    for i in range(held.shape[0]):
        gap = lower[i] - upper[i]
        if not gap <= 0.0:
            possible = possible and gap <= _TOLERANCE * _norm(i, problem) * size
        if i < problem.equalities:
            held[i] = 1
        elif held[i] != 0:
            bound = lower[i] if held[i] > 0 else upper[i]
            if not (warm and np.isfinite(bound)):
                held[i] = 0
    return bool(possible)


@kernel
def _norm(i: int, problem: QP) -> float:
    """Return ‖a‖ of constraint i, and 1 for a row of zeros."""
    if i >= problem.A.shape[0]:
        return 1.0
    square = squared_norm(problem.A[i, problem.begin[i] : problem.end[i]])
    return float(np.sqrt(square)) if square != 0.0 else 1.0


@kernel
def _negligible(i: int, problem: QP, work: Workspace) -> float:
    """Return the square of a remainder of Jᵀ a that is rounding."""
    norm = _norm(i, problem)
    return float(work.rounding[0] * norm * norm)


@kernel
def _settle(problem: QP, x: Array, work: Workspace) -> None:
    """Make y and x the optimum of the active constraints, without rounding of steps.

    L w = b - A x is what the active constraints lack; the multipliers grow by L⁻ᵀ w.
    Twice, at x0 and at y = Bᵀ multipliers, since the second time corrects the first;
    then y grows by Qᵀ w. Constraints with a multiplier of the wrong sign are released,
    the worst first: from what remains the method may begin.
    """
    y = work.vectors[0]
    while True:
        count = work.counts[0]
        L, w, shares = work.L, work.steps[0, :count], work.multipliers[:count]
        y[:] = 0.0
        _lack(problem, work.origin, w, work)
        solve_lower_transposed(L, w)
        copy(w, shares)
        add_rows(shares, work.B, y)
        _move(problem, x, work)
        _lack(problem, x, w, work)
        add_rows(w, work.Q, y)
        solve_lower_transposed(L, w)
        for c in range(count):
            shares[c] += w[c]
        wrong, least = count, 0.0
        for c in range(count):
            i = work.active[c]
            if i >= problem.equalities and work.held[i] * shares[c] < least:
                wrong, least = c, work.held[i] * shares[c]
        if wrong == count:
            break
        _release(wrong, work)
    _move(problem, x, work)


@kernel
def _lack(problem: QP, x: Array, w: Array, work: Workspace) -> None:
    """Write w = L⁻¹ (b - A x) of the active constraints."""
    for c in range(w.shape[0]):
        i = work.active[c]
        bound = problem.lower if work.held[i] > 0 else problem.upper
        w[c] = bound[i] - _value(i, problem, x, work.vectors[0])
    solve_lower(work.L, w)


@kernel
def _move(problem: QP, x: Array, work: Workspace) -> None:
    """Write x = x0 + J y."""
    JT, own, y = problem.JT, problem.own, work.vectors[0]
    nz, n = JT.shape
    copy(work.origin, x)
    add_rows(y[:nz], JT, x[:n])
    own_x, own_y = x[n:], y[nz : nz + own.shape[0]]
    for j in range(own.shape[0]):
        own_x[j] += own[j] * own_y[j]


@kernel
def _value(i: int, problem: QP, x: Array, y: Array) -> float:
    """Return a_i·x, and the slack if constraint i is soft."""
    A, softness, k = problem.A, problem.softness, problem.A.shape[0]
    total = 0.0
    if i >= k:
        total = x[i - k]
    else:
        begin, end = problem.begin[i], problem.end[i]
        row, part = A[i, begin:end], x[begin:end]
        for j in range(row.shape[0]):
            total += row[j] * part[j]
    if softness.shape[0] > 0:
        slack = y[problem.JT.shape[0] + problem.own.shape[0] :]
        total += softness[i] * slack[i]
    return total


@kernel
def _most_violated(
    tolerance: float, problem: QP, x: Array, work: Workspace
) -> tuple[int, float]:
    """Return the constraint that x is farthest from, marked as held, and its violation.

    It is -1 if x satisfies all. The distance is the violation divided by the length of
    the row. A row that contains NaN counts as violated.
    """
    lower, upper = problem.lower, problem.upper
    largest = 0.0
    for j in range(x.shape[0]):
        largest = max(largest, abs(x[j]))
    farthest = tolerance * (1.0 + largest)
    entering, side, violation = -1, 0, 0.0
    for i in range(work.held.shape[0]):
        if work.held[i] != 0:
            continue
        value = _value(i, problem, x, work.vectors[0])
        below, above = lower[i] - value, value - upper[i]
        if below <= 0.0 and above <= 0.0:
            continue
        beyond, norm = max(below, above), _norm(i, problem)
        if not beyond <= farthest * norm:
            farthest = beyond / norm
            entering, side, violation = i, 1 if below > above else -1, beyond
    if entering >= 0:
        work.held[entering] = side
    return entering, violation


@kernel
def _enter(entering: int, violation: float, problem: QP, work: Workspace) -> bool:
    """Make a violated constraint active; return False if that is impossible.

    Steps 2 and 3 of the method. Its multiplier grows from zero and y moves with it,
    until the constraint holds. An active one whose multiplier vanishes first is
    released.
    """
    y, remainder = work.vectors[0], work.vectors[1]
    side, multiplier = work.held[entering], 0.0
    square = _remainder(entering, problem, work)
    negligible = _negligible(entering, problem, work)
    while True:
        work.counts[1] += 1
        count = work.counts[0]
        independent = square > negligible
        rate = work.steps[1, :count]  # of the multipliers, Lᵀ rate = Q b
        for c in range(count):
            rate[c] = work.steps[0, c]
        solve_lower_transposed(work.L, rate)
        step, leaving = violation / square if independent else np.inf, -1
        for c in range(count):
            i = work.active[c]
            decrease = side * work.held[i] * rate[c]
            if i >= problem.equalities and decrease > 0.0:
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
        count = work.counts[0]  # the remainder gains what is freed
        freed, share = work.Q[count], work.steps[0, count]
        for j in range(y.shape[0]):
            remainder[j] += share * freed[j]
        square = squared_norm(remainder)


@kernel
def _remainder(i: int, problem: QP, work: Workspace) -> float:
    """Write b = Jᵀ a of constraint i, Q b, and what remains of b; return its square."""
    # b goes to the row of B after the active ones. If nine tenths of the length cancel,
    # the components are subtracted a second time ("twice is enough", Giraud et al.
    # 2005).
    count, remainder = work.counts[0], work.vectors[1]
    components, again = work.steps[0, :count], work.steps[2, :count]
    _write_row(i, problem, work.B[count])
    copy(work.B[count], remainder)
    before = squared_norm(remainder)
    if count == 0:
        return before
    multiply(work.Q[:count], remainder, components)
    for c in range(count):
        again[c] = -components[c]
    add_rows(again, work.Q, remainder)
    after = squared_norm(remainder)
    if after > 0.01 * before:
        return after
    multiply(work.Q[:count], remainder, again)
    for c in range(count):
        components[c] += again[c]
        again[c] = -again[c]
    add_rows(again, work.Q, remainder)
    return squared_norm(remainder)


@kernel
def _write_row(i: int, problem: QP, b: Array) -> None:
    """Write b = Jᵀ a of constraint i, and its softness."""
    JT, own, A = problem.JT, problem.own, problem.A
    nz, n = JT.shape
    b[:] = 0.0
    own_b = b[nz:]
    if i >= A.shape[0]:
        j = i - A.shape[0]
        if j < n:
            for r in range(nz):
                b[r] = JT[r, j]
        else:
            own_b[j - n] = own[j - n]
    else:
        begin, end = problem.begin[i], problem.end[i]
        if begin < n:
            row = A[i, : min(n, end)]
            for r in range(nz):
                total = 0.0
                for j in range(row.shape[0]):
                    total += JT[r, j] * row[j]
                b[r] = total
        first = max(begin - n, 0)
        rest, by, out = A[i, n + first : end], own[first:], own_b[first:]
        for j in range(rest.shape[0]):
            out[j] = by[j] * rest[j]
    if problem.softness.shape[0] > 0:
        slack = own_b[own.shape[0] :]
        slack[i] = problem.softness[i]


@kernel
def _extend(i: int, square: float, work: Workspace) -> None:
    """Add constraint i to the active ones: one more row of L and of Q."""
    # Its row of B is there already.
    count = work.counts[0]
    size = np.sqrt(square)
    row, q = work.L[count], work.Q[count]
    for c in range(count):
        row[c] = work.steps[0, c]
    row[count] = size
    for j in range(q.shape[0]):
        q[j] = work.vectors[1, j] / size
    work.active[count] = i
    work.multipliers[count] = 0.0
    work.counts[0] = count + 1


@kernel
def _release(leaving: int, work: Workspace) -> None:
    """Remove an active constraint: rotations make L lower triangular again."""
    # They leave the direction that is freed in the row of Q after the last, and rotate
    # the components Q b too.
    B, L, Q, components = work.B, work.L, work.Q, work.steps[0]
    count = work.counts[0] - 1
    work.held[work.active[leaving]] = 0
    work.counts[0] = count
    for r in range(leaving, count + 1):  # the last is that of an entering constraint
        copy(B[r + 1], B[r])
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
        a, b = components[r], components[r + 1]
        components[r], components[r + 1] = cosine * a + sine * b, cosine * b - sine * a
        for j in range(Q.shape[1]):
            a, b = Q[r, j], Q[r + 1, j]
            Q[r, j], Q[r + 1, j] = cosine * a + sine * b, cosine * b - sine * a
