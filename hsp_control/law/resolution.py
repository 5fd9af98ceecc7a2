"""The law with its buffers: from tasks and a field to one acceleration."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import (
    gram,
    norm,
    orthogonalise_rows,
    orthonormalise_rows,
)
from hsp_control.common.native import bind
from hsp_control.law.hierarchy import LevelScratch, resolve_levels
from hsp_control.law.law import acceleration, null_space_command
from hsp_control.law.outcome import BEYOND_ANY_LEVEL, Outcome, outcome_of
from hsp_control.law.problem import Problem
from hsp_control.law.pseudo_inverse import weighted_pseudo_inverse, whiten
from hsp_control.null_space.fields import FieldSample
from hsp_control.null_space.metrics import MetricSample
from hsp_control.tasks import TaskSample


class Resolved(NamedTuple):
    """The law's result at one state.

    Attributes:
        acceleration: a, shape (nv,).
        null_space_error: e_N = P(g - v), shape (nv,).
        outcome: Whether the law is exact.
    """

    acceleration: Array
    null_space_error: Array
    outcome: Outcome


class Factors(NamedTuple):
    """The two factors of the stack's pseudo-inverse, see `weighted_pseudo_inverse`.

    Attributes:
        Q: Shape (m, nv).
        X: Shape (m, m).
    """

    Q: Array
    X: Array


class Projectors(NamedTuple):
    """What `resolve_levels` leaves of its projectors, where it was needed.

    Level k takes Q_{k-1} J_kᵀ q(G_k) J_k Q_{k-1} of W⁻¹, and leaves Q_k.

    Attributes:
        Q: What the last level leaves, Q_K = P W⁻¹, shape (nv, nv).
        QJ: Q_{k-1} J_kᵀ of all levels side by side, shape (nv, m).
        G_inverse: q(G_k) of all levels along the diagonal, shape (m, m).
    """

    Q: Array
    QJ: Array
    G_inverse: Array


class Scratch(NamedTuple):
    """Memory of the law between its steps.

    Attributes:
        factors: The stack's pseudo-inverse.
        wide: Shape (m, nv).
        square: Shape (3, m, m).
        rows: Shape (7, max(m, nv)).
        tall: Shape (nv, m); for levels in conflict.
        inner: Shape (nv, nv); for levels in conflict.
    """

    factors: Factors
    wide: Array
    square: Array
    rows: Array
    tall: Array
    inner: Array


class Resolution:
    """The law for levels of tasks: its kernels and their buffers.

    It has scratch memory but no state: the same input gives the same output.

    Attributes:
        problem: The input, to be written before `resolve`.
        ends: End of each level's rows in the stack.
        form: The metric's form.
        threshold: Singular value below which the inverse is bounded.
        acceleration: a of the last `resolve`, shape (nv,).
        null_space_error: e_N of the last `resolve`, shape (nv,).
        code: What the last `resolve` returned, see `outcome_of`, shape (1,).
        factors: The stack's pseudo-inverse at the last `resolve`.
        alone: Whether the tasks of one level are resolved at once, whatever happens.
        projectors: The levels' projectors at the last `resolve`, if its code is not 0
            and the level is not alone.
    """

    def __init__(
        self, levels: Sequence[int], nv: int, form: int, gain: Array, threshold: float
    ) -> None:
        """Allocate.

        Args:
            levels: Rows of each level, the highest priority first.
            nv: Number of degrees of freedom.
            form: The metric's form.
            gain: Null-space gain K_N, shape (nv, nv) [1/s].
            threshold: Singular value of the whitened Jacobian below which its inverse
                is bounded.
        """
        m = sum(levels)
        self.problem = Problem(m, nv, gain)
        self.ends: Indices = np.cumsum([*levels] or [0], dtype=np.int64)
        self.form = form
        self.threshold = threshold
        self.factors = Factors(np.zeros((m, nv)), np.zeros((m, m)))
        self._scratch = Scratch(
            self.factors,
            np.zeros((m, nv)),
            np.zeros((3, m, m)),
            np.zeros((7, max(m, nv))),
            np.zeros((nv, m)),
            np.zeros((nv, nv)),
        )
        # A conflict takes two levels, or more rows than degrees of freedom. Its kernel
        # is the largest of all: only who needs it compiles it.
        self.alone = len(self.ends) == 1 and m <= nv
        scratch = self._scratch
        self.projectors = Projectors(scratch.inner, scratch.tall, scratch.square[2])
        self.acceleration = self.problem.record.acceleration
        self.null_space_error = self.problem.record.null_space_error
        self.code: Indices = np.zeros(1, dtype=np.int64)
        self._spectra: dict[int, tuple[Callable[[], float], Array]] = {}

    def resolve(self, v: Array, *, controls_null_space: bool = True) -> Resolved:
        """Return the acceleration that tracks the tasks and the field.

        Args:
            v: Velocity, shape (nv,).
            controls_null_space: False for φ_N = 0, the paper's first simulation.
        """
        code = self.compile(v, controls=controls_null_space)()
        return Resolved(self.acceleration, self.null_space_error, outcome_of(code))

    def compile(self, v: Array, *, controls: bool) -> Callable[[], float]:
        """Return the call that `resolve` makes; it returns what `outcome_of` takes.

        Args:
            v: The velocity, shape (nv,); the call reads this array each time.
            controls: False for φ_N = 0.
        """
        problem = self.problem
        alone = self.alone
        return bind(
            _resolve_at_once if alone else _resolve_levels,
            *(problem.task, problem.field, problem.metric, self.form),
            *(v, problem.gain, self.threshold, controls),
            *(() if alone else (self.ends,)),
            *(self._scratch, self.null_space_error, self.acceleration, self.code),
        )

    def diagnose(self, first: int = 0) -> tuple[Array, float, float]:
        """Return what tells how near the last `resolve` was to singular and to rest.

        Args:
            first: The first row of the tasks: those before it belong to contacts.

        Returns:
            The singular values of J L⁻ᵀ without the rows before ``first``, the largest
            first; their squared product det(J W⁻¹ Jᵀ), the paper's manipulability; and
            ‖e_N‖_W, the square root of 2 V.
        """
        found = self._spectra.get(first)
        if found is None:
            J, metric = self.problem.task.jacobian[first:], self.problem.metric
            out = np.zeros(min(J.shape) + 1)
            m, n = self.problem.task.jacobian.shape
            wide, small = np.zeros((2, m, n)), np.zeros((3, m, m))
            e_N, form = self.null_space_error, self.form
            call = bind(_diagnose, J, *metric[:2], form, e_N, wide, small, out)
            self._spectra[first] = found = call, out
        manipulability = found[0]()
        numbers = found[1].copy()
        return numbers[:-1], manipulability, float(numbers[-1])


@kernel
def _resolve_at_once(
    task: TaskSample,
    field: FieldSample,
    metric: MetricSample,
    form: int,
    v: Array,
    K_N: Array,
    threshold: float,
    controls: bool,
    scratch: Scratch,
    e_N: Array,
    a: Array,
    code: Indices,
) -> int:
    """Write e_N and a of all tasks at once; write and return the code of `outcome_of`.

    If the tasks of several levels are exact together, they are exact one after the
    other: this is the same then.
    """
    n = task.jacobian.shape[1]
    (Q, X), rows = scratch.factors, scratch.rows
    u = rows[6, :n]
    damped = int(
        weighted_pseudo_inverse(
            task.jacobian, metric.L, form, threshold, scratch.wide, Q, X
        )
    )
    null_space_command(task, field, metric, form, Q, X, v, K_N, rows, e_N, u)
    if not controls:
        for i in range(n):
            u[i] = 0.0
    acceleration(task, metric.L, form, Q, X, v, u, rows, a)
    code[0] = damped if _all_finite(a) else BEYOND_ANY_LEVEL
    return int(code[0])


@kernel
def _resolve_levels(
    task: TaskSample,
    field: FieldSample,
    metric: MetricSample,
    form: int,
    v: Array,
    K_N: Array,
    threshold: float,
    controls: bool,
    ends: Indices,
    scratch: Scratch,
    e_N: Array,
    a: Array,
    code: Indices,
) -> int:
    """Write e_N and a: of all levels at once, or level by level if they conflict.

    The code of `outcome_of` is written and returned.
    """
    damped = 1
    if task.jacobian.shape[0] <= task.jacobian.shape[1]:
        damped = _resolve_at_once(
            task,
            field,
            metric,
            form,
            v,
            K_N,
            threshold,
            controls,
            scratch,
            e_N,
            a,
            code,
        )
    if damped > 0:
        levels = LevelScratch(
            scratch.inner, scratch.tall, scratch.square[2], scratch.square, scratch.rows
        )
        damped = resolve_levels(
            task, field, metric, form, v, K_N, threshold, controls, ends, levels, e_N, a
        )
        if not _all_finite(a):
            damped = BEYOND_ANY_LEVEL
        code[0] = damped
    return damped


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
    wide: Array,
    small: Array,
    out: Array,
) -> float:
    """Write the singular values of J L⁻ᵀ and then ‖e_N‖_W; return det(J W⁻¹ Jᵀ)."""
    out[-1] = norm(W, e_N)
    return float(_singular_values(J, L, form, wide, small, out[:-1]))


@kernel
def _singular_values(
    J: Array, L: Array, form: int, wide: Array, small: Array, values: Array
) -> float:
    """Write the singular values of J L⁻ᵀ, largest first; J of any shape.

    Returns:
        Their product squared; 1 without rows.
    """
    m, n = J.shape
    if m == 0:
        return 1.0
    width = min(m, n)
    B, T, U = wide[0, :m], small[0, :m, :m], small[1, :m, :m]
    whiten(J, L, form, B)
    if m <= n:
        # The columns of the triangular factor are nearer to orthogonal than the rows.
        Q = wide[1, :m]
        orthonormalise_rows(B, Q, U)
        gram(Q, B, False, T)
        for i in range(m):
            for k in range(m):
                B[i, k] = T[i, k]
    orthogonalise_rows(B[:, :width], U[:0])
    squares = small[2, 0, :m]
    for k in range(m):
        squares[k] = 0.0
        for i in range(width):
            squares[k] += B[k, i] * B[k, i]
    product = 1.0
    for rank in range(values.shape[0]):
        best = rank
        for k in range(rank + 1, m):
            if squares[k] > squares[best]:
                best = k
        squares[rank], squares[best] = squares[best], squares[rank]
        values[rank] = np.sqrt(squares[rank])
        product *= squares[rank]
    return product
