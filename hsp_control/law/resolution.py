"""The law with its buffers: from tasks and a field to one acceleration."""

from collections.abc import Sequence
from enum import IntEnum
from math import isqrt
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.compiled.linalg import (
    bounded_inverse,
    copy,
    multiply,
    norm,
    orthogonalise_rows,
    squared_norm,
    triangularise_rows,
)
from hsp_control.law.edge import EdgeMemory, far_share, near_share
from hsp_control.law.hierarchy import LevelScratch, resolve_levels
from hsp_control.law.law import acceleration, null_space_command
from hsp_control.law.problem import Problem
from hsp_control.law.pseudo_inverse import apply_pseudo_inverse, whiten
from hsp_control.law.samples import FieldSample, MetricSample, TaskSample
from hsp_control.law.threshold import (
    NOT,
    Following,
    Thresholds,
    turning_threshold,
    write_thresholds,
)


class Outcome(IntEnum):
    """Whether the law's equations hold."""

    EXACT = 0
    """They hold: all singular values are above the threshold."""
    DAMPED = 1
    """A singular value is below the threshold: the inverse was bounded instead."""
    NOT_FINITE = 2
    """The acceleration contains NaN or inf."""


EXACT, DAMPED, NOT_FINITE = tuple(Outcome)
"""By name, for the step: up to Python 3.11 `Outcome.EXACT` takes 80 ns."""

BEYOND_ANY_LEVEL = 1_000_000
"""What kernels return if the acceleration is not finite."""


def outcome_of(code: float) -> Outcome:
    """Return the outcome that a kernel's number means.

    Args:
        code: 0: exact; from 1 on, the first level with a bounded inverse; or
            `BEYOND_ANY_LEVEL`.
    """
    if code == 0.0:
        return EXACT
    return DAMPED if code < BEYOND_ANY_LEVEL else NOT_FINITE


class Factors(NamedTuple):
    """The two factors of the stack's pseudo-inverse, see `pseudo_inverse.py`."""

    Q: Array  # (m, nv)
    X: Array  # (m, m)


class Projectors(NamedTuple):
    """What `resolve_levels` leaves of its projectors, where it was needed.

    Level k takes Q_{k-1} J_kᵀ q(G_k) J_k Q_{k-1} of W⁻¹, and leaves Q_k.
    """

    Q: Array  # what the last level leaves, Q_K = P W⁻¹, shape (nv, nv)
    QJ: Array  # Q_{k-1} J_kᵀ of all levels side by side, shape (nv, m)
    G_inverse: Array  # q(G_k) of all levels along the diagonal, shape (m, m)


class Scratch(NamedTuple):
    """Memory of the law between its steps."""

    factors: Factors  # the stack's pseudo-inverse
    wide: Array  # (m, nv)
    square: Array  # (3, m, m)
    rows: Array  # (7, max(m, nv))
    tall: Array  # (nv, m); for levels in conflict
    inner: Array  # (nv, nv); for levels in conflict
    edge: EdgeMemory


class Resolution:
    """The law for levels of tasks: its kernels and their buffers.

    It has scratch memory but no state: the same input gives the same output.

    Attributes:
        problem: The input, to be written before `call` is made.
        ends: End of each level's rows in the stack.
        form: The metric's form.
        threshold: ε_0, the singular value below which the inverse is always bounded.
        thresholds: ε of each level, as `call` wrote it last, shape (levels,).
        acceleration: a, as `call` wrote it last, shape (nv,).
        null_space_error: e_N, as `call` wrote it last, shape (nv,).
        code: What `call` returned last, see `outcome_of`, shape (1,).
        factors: The stack's pseudo-inverse then.
        alone: Whether the tasks of one level are resolved at once, whatever happens.
        projectors: The levels' projectors then, if the code is not 0 and the level is
            not alone.
    """

    def __init__(
        self,
        levels: Sequence[int],
        nv: int,
        form: int,
        gain: Array,
        threshold: float,
        following: Following = NOT,
    ) -> None:
        """Allocate."""
        m = sum(levels)
        self.problem = Problem(m, nv, gain)
        self.ends: Indices = np.cumsum([*levels] or [0], dtype=np.int64)
        self.form = form
        self.threshold, self._following = threshold, following
        self._thresholds = Thresholds.allocate(len(self.ends))
        self.thresholds = self._thresholds.own
        self.thresholds[:] = threshold
        self.factors = Factors(np.zeros((m, nv)), np.zeros((m, m)))
        self._scratch = Scratch(
            self.factors,
            np.zeros((m, nv)),
            np.zeros((3, m, m)),
            np.zeros((7, max(m, nv))),
            np.zeros((nv, m)),
            np.zeros((nv, nv)),
            EdgeMemory.allocate(m, nv),
        )
        self.edge = self._scratch.edge
        # Only a fixed base has a law beside the damped one. Who stands keeps the
        # balance by tasks that nothing damps.
        self._exact_beside = following.size > 0.0 and m <= nv and not following.legs
        # A conflict takes two levels, or more rows than degrees of freedom. Its kernel
        # is the largest of all: only who needs it compiles it.
        self.alone = len(self.ends) == 1 and m <= nv
        scratch = self._scratch
        self.projectors = Projectors(scratch.inner, scratch.tall, scratch.square[2])
        self.acceleration = self.problem.record.acceleration
        self.null_space_error = self.problem.record.null_space_error
        self.code: Indices = np.zeros(1, dtype=np.int64)

    def call(self, v: Array, *, controls: bool = True) -> KernelCall:
        """Return the call that writes a and e_N; it returns what `outcome_of` takes."""
        resolve = _resolve_stack if self.alone else _resolve_priorities
        return resolve, (self._step(v, controls),)

    def self_motions(self, v: Array) -> KernelCall:
        """Return the call that writes the parts of a and of a_damped, after `call`.

        It writes to `edge`.
        """
        return _write_self_motions, (self._step(v, controls=True),)

    def _step(self, v: Array, controls: bool) -> "LawStep":
        problem = self.problem
        step = (
            *(problem.task, problem.field, problem.metric, self.form),
            *(v, problem.gain, self.threshold, self._following, controls),
            *(self._exact_beside, self.alone),
            *(self.ends, problem.asked, problem.yields, problem.pulls, problem.springs),
            *(problem.stretched, self._thresholds, self._scratch),
            *(self.null_space_error, self.acceleration, self.code),
        )
        return LawStep._make(step)

    def diagnosis(self, first: int) -> tuple[KernelCall, Array, Array]:
        """Return a call that finds how near the law is to singular and to rest.

        Args:
            first: The first row of the tasks: those before it belong to contacts.

        Returns:
            The call, which returns det(J W⁻¹ Jᵀ) without the rows before ``first``, the
            paper's manipulability; and what it writes: what `singular_values` takes,
            and ‖e_N‖_W, the square root of 2 V, shape (1,).
        """
        J, metric = self.problem.task.jacobian[first:], self.problem.metric
        small, large = sorted(J.shape)
        scratch, e_N = np.zeros((2, large, large)), self.null_space_error
        T, length = np.zeros((small, small)), np.zeros(1)
        given = J, *metric[:2], self.form, e_N, scratch, T, length
        return (_diagnose, given), T, length


def singular_values(triangle: bytes) -> Array:
    """Return the singular values of J L⁻ᵀ, the largest first, shape (min(m, nv),).

    Args:
        triangle: What the call of `Resolution.diagnosis` wrote, as bytes.
    """
    T = np.frombuffer(triangle).copy()
    values = np.zeros(isqrt(len(T)))
    _singular_values(T.reshape(len(values), len(values)), values)
    return values


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


@kernel
def _resolve_stack(step: LawStep) -> int:
    """Resolve the tasks of one level; see `_mixed`."""
    return _mixed(step, _resolve_at_once(step))


@kernel
def _resolve_priorities(step: LawStep) -> int:
    """Resolve the tasks of several levels; see `_mixed`."""
    return _mixed(step, _resolve_levels(step))


@kernel
def _mixed(step: LawStep, damped: int) -> int:
    """Overwrite a_damped by a, and e_N; write and return the code of `outcome_of`.

    The first two shares of `edge.py` count here.
    """
    edge, a, e_N = step.scratch.edge, step.a, step.e_N
    edge.code[0] = damped
    if damped == 0:
        edge.share[0] = 0.0
        return damped
    n = a.shape[0]
    copy(a, edge.damped)
    edge.share[0] = 1.0
    if damped >= BEYOND_ANY_LEVEL or not step.exact_beside:
        return damped
    share = far_share(step.stretched)
    if share < 1.0:
        J, size = step.task.jacobian, step.following.size
        near = near_share(J, size, step.threshold, edge.turned)
        share = max(share, near)
    if share == 1.0:
        return damped
    edge.share[0] = share
    _resolve_exactly(step, edge.Q, edge.X, edge.exact_e_N)
    copy(a, edge.exact)
    for i in range(n):
        a[i] += share * (edge.damped[i] - a[i])
        e_N[i] = edge.exact_e_N[i] + share * (e_N[i] - edge.exact_e_N[i])
    if share == 0.0:
        step.code[0] = 0
    return int(step.code[0])


@kernel
def _resolve_exactly(step: LawStep, Q: Array, X: Array, e_N: Array) -> None:
    """Write e_N and a of all tasks at once, whatever they ask for."""
    bounded_inverse(step.scratch.wide, 0.0, Q, X)
    _write_law(step, Q, X, e_N)


@kernel
def _write_law(step: LawStep, Q: Array, X: Array, e_N: Array) -> None:
    """Write e_N and a for an inverse Qᵀ X: equations (13) and (7)."""
    task, metric, form, v = step.task, step.metric, step.form, step.v
    rows = step.scratch.rows
    u = rows[6, : v.shape[0]]
    null_space_command(task, step.field, metric, form, Q, X, v, step.K_N, rows, e_N, u)
    if not step.controls:
        for i in range(u.shape[0]):
            u[i] = 0.0
    acceleration(task, metric.L, form, Q, X, v, u, rows, step.a)


@kernel
def _resolve_at_once(step: LawStep) -> int:
    """Write e_N and a of all tasks at once; write and return the code of `outcome_of`.

    If the tasks of several levels are exact together, they are exact one after the
    other: this is the same then.
    """
    (Q, X), B, a = step.scratch.factors, step.scratch.wide, step.a
    whiten(step.task.jacobian, step.metric.L, step.form, B)
    damped = int(bounded_inverse(B, _write_thresholds(step), Q, X))
    _write_law(step, Q, X, step.e_N)
    step.code[0] = damped if _all_finite(a) else BEYOND_ANY_LEVEL
    return int(step.code[0])


@kernel
def _resolve_levels(step: LawStep) -> int:
    """Write e_N and a: of all levels at once, or level by level if they conflict.

    The code of `outcome_of` is written and returned.
    """
    task, scratch, damped = step.task, step.scratch, 1
    if task.jacobian.shape[0] <= task.jacobian.shape[1]:
        damped = _resolve_at_once(step)
    else:
        whiten(task.jacobian, step.metric.L, step.form, scratch.wide)
        _write_thresholds(step)
    if damped > 0:
        levels = LevelScratch(
            scratch.inner, scratch.tall, scratch.square[2], scratch.square, scratch.rows
        )
        damped = resolve_levels(
            task, step.field, step.metric, step.form, step.v, step.K_N, step.threshold,
            step.following, step.asked, step.yields, step.springs, step.thresholds,
            step.controls, step.ends, levels, step.e_N, step.a,
        )  # fmt: skip
        if not _all_finite(step.a):
            damped = BEYOND_ANY_LEVEL
        step.code[0] = damped
    return damped


@kernel
def _write_self_motions(step: LawStep) -> None:
    """Write P a of a and of a_damped, and K_N P v of both."""
    edge, rows = step.scratch.edge, step.scratch.rows
    n, share = step.v.shape[0], edge.share[0]
    exact, moved = rows[3, :n], rows[4, :n]
    if edge.code[0] == 0:  # there is one law
        copy(step.a, edge.damped)
    _damped_self_motion(step, edge.damped, edge.self_motions[1])
    _damped_self_motion(step, step.v, moved)
    multiply(step.K_N, moved, edge.brakings[1])
    copy(edge.self_motions[1], edge.self_motions[0])
    copy(edge.brakings[1], edge.brakings[0])
    if edge.code[0] == 0 or share == 1.0:
        return
    _self_motion(step, edge.Q, edge.X, edge.exact, exact)
    for i in range(n):
        edge.self_motions[0, i] = exact[i] + share * (
            edge.self_motions[1, i] - exact[i]
        )
    _self_motion(step, edge.Q, edge.X, step.v, moved)
    multiply(step.K_N, moved, exact)
    for i in range(n):
        edge.brakings[0, i] = exact[i] + share * (edge.brakings[1, i] - exact[i])


@kernel
def _damped_self_motion(step: LawStep, x: Array, out: Array) -> None:
    """Write P x, with the inverse of the damped law."""
    if step.scratch.edge.code[0] == 0 or step.alone:
        Q, X = step.scratch.factors
        _self_motion(step, Q, X, x, out)
    else:
        lowered = step.scratch.rows[2, : x.shape[0]]
        multiply(step.metric.W, x, lowered)
        multiply(step.scratch.inner, lowered, out)


@kernel
def _self_motion(step: LawStep, Q: Array, X: Array, x: Array, out: Array) -> None:
    """Write x - J# J x, for an inverse Qᵀ X."""
    J, rows = step.task.jacobian, step.scratch.rows
    m, n = J.shape
    moves, part, back = rows[0, :m], rows[1, :m], rows[2, :n]
    multiply(J, x, moves)
    apply_pseudo_inverse(Q, X, step.metric.L, step.form, moves, part, back)
    for i in range(n):
        out[i] = x[i] - back[i]


@kernel
def _write_thresholds(step: LawStep) -> float:
    """See `write_thresholds`: J is whitened before."""
    turning = turning_threshold(step.field.g, step.v, step.following)
    return write_thresholds(
        step.task.jacobian, step.scratch.wide, step.asked, step.yields, step.pulls,
        step.springs, step.ends, step.threshold, turning, step.following,
        step.thresholds,
    )  # fmt: skip


@kernel
def _all_finite(a: Array) -> bool:
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i]
    return bool(np.isfinite(total))


@kernel
def _diagnose(
    J: Array,
    W: Array,
    L: Array,
    form: int,
    e_N: Array,
    scratch: Array,
    T: Array,
    length: Array,
) -> float:
    """Write T, triangular with the singular values of J L⁻ᵀ, and ‖e_N‖_W.

    Returns:
        The product of their squares.
    """
    length[0] = norm(W, e_N)
    m, n = J.shape
    B = scratch[0, :m, :n]
    whiten(J, L, form, B)
    if m > n:
        transposed = scratch[1, :n, :m]
        for i in range(n):
            for k in range(m):
                transposed[i, k] = B[k, i]
        B = transposed
    product = triangularise_rows(B)
    for i in range(T.shape[0]):
        for k in range(i + 1):
            T[i, k] = B[i, k]
    return float(product)


@kernel
def _singular_values(T: Array, values: Array) -> None:
    """Write the singular values of a triangle, the largest first; T is overwritten.

    Its columns are nearer to orthogonal than the rows of what it is a factor of.
    """
    orthogonalise_rows(T, T[:0])
    m = values.shape[0]
    for k in range(m):
        values[k] = np.sqrt(squared_norm(T[k]))
    for rank in range(m):
        best = rank
        for k in range(rank + 1, m):
            if values[k] > values[best]:
                best = k
        values[rank], values[best] = values[best], values[rank]
