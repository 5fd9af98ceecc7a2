"""Random QPs of many kinds, their solution by other solvers, KKT residuals.

The oracles solve in y, x = x0 + J y, with rows of length 1: there the cost is ½ ‖y‖²,
so that scales of cost and rows affect them least.
"""

from collections.abc import Callable
from typing import NamedTuple

import daqp
import numpy as np
from numpy.typing import NDArray

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.control.actuation.dual_active_set import QP, Workspace

Generator = np.random.Generator


class Case(NamedTuple):
    """A QP: minimise ½ ‖y‖² over x = x0 + J y, lower ≤ (A x, x) ≤ upper."""

    JT: Array
    A: Array
    lower: Array
    upper: Array
    equalities: int
    x0: Array
    feasible: bool = True

    @property
    def rows(self) -> Array:
        """All constraints as rows on x."""
        return np.vstack([self.A, np.eye(len(self.x0))])


class Answer(NamedTuple):
    """The solver's result."""

    code: int
    x: Array
    active: NDArray[np.int64]
    sides: NDArray[np.int64]
    multipliers: Array
    iterations: int


# --- kinds ---------------------------------------------------------------------------


def dense(rng: Generator) -> Case:
    n, k = int(rng.integers(1, 13)), int(rng.integers(1, 21))
    return around(rng, factor(rng, n, n), rng.standard_normal((k, n)))


def prioritised(rng: Generator) -> Case:
    """Costs of motions that differ by 1e8, as those of a law with three levels."""
    n, k = int(rng.integers(3, 13)), int(rng.integers(1, 13))
    Q = np.linalg.qr(rng.standard_normal((n, n)))[0]
    JT = Q * (10.0 ** (2.0 * rng.integers(0, 3, n)))[:, None]
    return around(rng, JT, rng.standard_normal((k, n)))


def equalities(rng: Generator) -> Case:
    n, k = int(rng.integers(2, 13)), int(rng.integers(2, 16))
    count = int(rng.integers(1, min(n, k) + 1))
    return around(rng, factor(rng, n, n), rng.standard_normal((k, n)), count)


def degenerate(rng: Generator) -> Case:
    """Degenerate: more rows through a point than unknowns; repeated, parallel,
    opposite."""
    n = int(rng.integers(1, 9))
    A = rng.standard_normal((2 * n, n))
    again = rng.choice([-3.0, -1.0, 0.1, 1.0, 1e3], 2 * n)[:, None] * A
    A = np.vstack([A, again, np.round(rng.standard_normal((n, n)))])
    case = around(rng, factor(rng, n, n), A)
    corner = case.x0 + case.JT.T @ rng.standard_normal(len(case.JT))
    at = case.rows @ corner
    side = rng.random(len(at)) < 0.5
    width = rng.uniform(0.0, 3.0, len(at))
    lower = np.where(side, at, at - width)
    return case._replace(lower=lower, upper=np.where(side, at + width, at))


def badly_scaled(rng: Generator) -> Case:
    case = dense(rng)
    k = len(case.A)
    scale = 10.0 ** rng.uniform(-4.0, 4.0, k)
    lower, upper = case.lower.copy(), case.upper.copy()
    lower[:k] *= scale
    upper[:k] *= scale
    return case._replace(A=scale[:, None] * case.A, lower=lower, upper=upper)


def pinned(rng: Generator) -> Case:
    """Rows with lower = upper that are not declared as equalities."""
    n, k = int(rng.integers(2, 11)), int(rng.integers(2, 11))
    return around(
        rng, factor(rng, n, n), rng.standard_normal((k, n)), min(n - 1, k)
    )._replace(equalities=0)


def bounds_only(rng: Generator) -> Case:
    n = int(rng.integers(1, 15))
    return around(rng, factor(rng, n, n), np.zeros((0, n)))


def unspanned(rng: Generator) -> Case:
    """Some motions are excluded: J has fewer columns than rows."""
    n = int(rng.integers(2, 13))
    nz = int(rng.integers(1, n))
    k = int(rng.integers(1, 13))
    return around(rng, factor(rng, nz, n), rng.standard_normal((k, n)), nz // 3)


def with_zeros(rng: Generator) -> Case:
    """Rows of zeros, and rows and columns with zeros at their ends."""
    n, k = int(rng.integers(2, 13)), int(rng.integers(2, 13))
    A, JT = rng.standard_normal((k, n)), factor(rng, n, n)
    for row in (*A, *JT[: n // 2]):
        begin, end = np.sort(rng.integers(0, n + 1, 2))
        row[:begin] = row[end:] = 0.0
    return around(rng, JT, A)


def uncoupled(rng: Generator) -> Case:
    """The last unknowns have separate costs, like forces."""
    n, p, k = int(rng.integers(0, 7)), int(rng.integers(1, 7)), int(rng.integers(1, 13))
    nz = int(rng.integers(0, n + 1))
    JT = np.zeros((nz + p, n + p))
    JT[:nz, :n] = factor(rng, nz, n)
    JT[nz:, n:] = np.diag(10.0 ** rng.uniform(-1.0, 1.0, p))
    A = rng.standard_normal((k, n + p))
    for row in A:
        begin, end = np.sort(rng.integers(0, n + p + 1, 2))
        row[:begin] = row[end:] = 0.0
    return around(rng, JT, A)


def redundant(rng: Generator) -> Case:
    """Redundant equalities."""
    case = equalities(rng)
    count, extra = case.equalities, int(rng.integers(1, 4))
    mix = rng.standard_normal((extra, count))
    return case._replace(
        A=np.vstack([mix @ case.A[:count], case.A]),
        lower=np.concatenate([mix @ case.lower[:count], case.lower]),
        upper=np.concatenate([mix @ case.upper[:count], case.upper]),
        equalities=count + extra,
    )


def infeasible(rng: Generator) -> Case:
    """Infeasible: the bound on a combination of rows contradicts the rows'."""
    case = (dense, equalities, unspanned, badly_scaled)[rng.integers(4)](rng)
    rows, part = case.rows, rng.standard_normal(len(case.rows))
    part[rng.random(len(rows)) < 0.5] = 0.0
    part[~np.isfinite(case.lower) | ~np.isfinite(case.upper)] = 0.0
    part /= norms(rows)
    used = part != 0.0
    ends = part[used] * np.array([case.lower[used], case.upper[used]])
    most = ends.max(axis=0).sum()
    row = part @ rows
    size = max(np.linalg.norm(row), 1.0)
    margin = size * 10.0 ** rng.uniform(-3.0, 0.0)
    k = len(case.A)
    return case._replace(
        A=np.vstack([case.A, row]),
        lower=np.insert(case.lower, k, most + margin),
        upper=np.insert(case.upper, k, np.inf),
        feasible=False,
    )


KINDS: dict[str, Callable[[Generator], Case]] = {
    kind.__name__: kind
    for kind in (
        dense,
        prioritised,
        equalities,
        degenerate,
        badly_scaled,
        pinned,
        bounds_only,
        unspanned,
        with_zeros,
        uncoupled,
        redundant,
        infeasible,
    )
}


def factor(rng: Generator, nz: int, n: int) -> Array:
    """Return Jᵀ with singular values from 0.1 to 10."""
    U = np.linalg.qr(rng.standard_normal((nz, nz)))[0]
    V = np.linalg.qr(rng.standard_normal((n, nz)))[0]
    return np.asarray((U * 10.0 ** rng.uniform(-1.0, 1.0, nz)) @ V.T)


def around(rng: Generator, JT: Array, A: Array, count: int = 0) -> Case:
    """Return constraints that a random point satisfies; the first are equalities."""
    (nz, n), k = JT.shape, len(A)
    x0 = rng.standard_normal(n)
    rows = np.vstack([A, np.eye(n)])
    inside = rows @ (x0 + JT.T @ rng.standard_normal(nz))
    size = np.linalg.norm(rows, axis=1)
    below, above = size * rng.uniform(0.0, 2.0, (2, k + n))
    below[rng.random(k + n) < 0.2] = np.inf
    above[rng.random(k + n) < 0.2] = np.inf
    below[:count] = above[:count] = 0.0
    return Case(JT, A, inside - below, inside + above, count, x0)


# --- solutions -----------------------------------------------------------------------


def spans(A: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the range of non-zero entries in each row."""
    begin, end = np.zeros((2, len(A)), dtype=np.int64)
    for i, row in enumerate(A):
        filled = np.flatnonzero(row)
        if len(filled):
            begin[i], end[i] = filled[0], filled[-1] + 1
    return begin, end


def packed(case: Case, softness: Array | None = None) -> QP:
    """Return the solver's argument; J's last single-entry columns are separate."""
    soft = np.zeros(0) if softness is None else softness
    A, (nz, n) = np.ascontiguousarray(case.A), case.JT.shape
    own = 0
    while own < nz and _is_alone(case.JT, nz - own - 1, n - own - 1):
        own += 1
    JT = np.ascontiguousarray(case.JT[: nz - own, : n - own])
    rest = np.diag(case.JT[nz - own :, n - own :]).copy()
    ends = case.lower, case.upper, soft, case.equalities
    return QP(JT, rest, A, *spans(A), *ends)


def _is_alone(JT: Array, row: int, column: int) -> bool:
    """Return whether an entry is the only one of its row and of its column."""
    others = np.count_nonzero(JT[row]) + np.count_nonzero(JT[:, column])
    return bool(JT[row, column] != 0.0 and others == 2)


def answer(
    case: Case,
    softness: Array | None = None,
    work: Workspace | None = None,
    iterations: int = 10,
) -> Answer:
    """Return the solver's solution; ``work``: a workspace for a warm start."""
    x, warm = case.x0.copy(), work is not None
    if work is None:
        work = Workspace.of(len(x), len(case.A), softness is not None)
    code = engine.Minimise(
        problem=packed(case, softness),
        iterations=iterations,
        warm=warm,
        x=x,
        work=work,
    )()
    active = work.active[: work.counts[0]].copy()
    return Answer(
        int(code),
        x,
        active,
        work.held[active],
        work.multipliers[: len(active)].copy(),
        int(work.counts[1]),
    )


def in_y(case: Case) -> tuple[Array, Array, Array] | None:
    """Return the constraints as rows of length 1 on y.

    Rows of zeros are omitted; None if one of them is violated.
    """
    rows, offset = case.rows @ case.JT.T, case.rows @ case.x0
    lower, upper, size = case.lower - offset, case.upper - offset, norms(rows)
    some = size > 1e-12 * norms(case.rows)
    if (lower[~some] > 1e-9).any() or (upper[~some] < -1e-9).any():
        return None
    size = size[some]
    return rows[some] / size[:, None], lower[some] / size, upper[some] / size


def norms(rows: Array) -> Array:
    """Return the length of each row."""
    return np.asarray(np.linalg.norm(rows, axis=1))


def by_daqp(case: Case) -> Array | None:
    """Return x by DAQP, or None."""
    constraints, nz = in_y(case), len(case.JT)
    if constraints is None:
        return None
    C, lower, upper = constraints
    sense = np.where(upper - lower < 1e-12, 5, 0).astype(np.int32)
    y, _, flag, _ = daqp.solve(
        np.eye(nz), np.zeros(nz), C, upper, lower, sense, primal_tol=1e-11
    )
    return case.x0 + case.JT.T @ y if flag >= 1 else None


# --- optimality ----------------------------------------------------------------------


def cost(case: Case, x: Array) -> float:
    """Return ½ ‖y‖² of the least y with x = x0 + J y."""
    y = np.linalg.lstsq(case.JT.T, x - case.x0, rcond=None)[0]
    return float(0.5 * y @ y)


def residual(case: Case, x: Array) -> float:
    """Return the distance from x to the worst constraint, relative to 1 + |x|."""
    value, size = case.rows @ x, norms(case.rows)
    beyond = np.maximum(case.lower - value, value - case.upper)
    size = np.where(size > 0.0, size, 1.0)
    return float(max((beyond / size).max(), 0.0) / (1.0 + np.abs(x).max()))


def defect(case: Case, found: Answer) -> float:
    """Return the residual of the Karush-Kuhn-Tucker conditions.

    The largest of: the residual; the distance of x from x0 + J Bᵀ u, relative to 1 +
    |x|; the relative gap between primal and dual cost. Multipliers of a wrong sign give
    inf.
    """
    u, active = found.multipliers, found.active
    free = active >= case.equalities
    if (found.sides[free] * u[free] < 0.0).any():
        return np.inf
    B = case.rows[active] @ case.JT.T
    y = B.T @ u
    bound = np.where(found.sides > 0, case.lower[active], case.upper[active])
    dual = u @ (bound - case.rows[active] @ case.x0) - 0.5 * y @ y
    primal = 0.5 * y @ y
    moved = np.abs(case.x0 + case.JT.T @ y - found.x).max()
    return float(
        max(
            residual(case, found.x),
            moved / (1.0 + np.abs(found.x).max()),
            abs(primal - dual) / max(1.0, primal),
        )
    )
