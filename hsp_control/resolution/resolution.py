"""From tasks and a field to one acceleration: the law with its memory."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.arrays import Array, Indices
from hsp_control.kernels import bind, kernel
from hsp_control.linalg import orthogonalise_columns, solve_lower
from hsp_control.metrics.metric import IDENTITY
from hsp_control.resolution.hierarchy import resolve_levels
from hsp_control.resolution.law import acceleration, null_space_command
from hsp_control.resolution.problem import Problem, parts
from hsp_control.resolution.pseudo_inverse import weighted_pseudo_inverse


class Resolved(NamedTuple):
    """What the law decided at one state.

    Attributes:
        acceleration: a, shape (nv,).
        null_space_error: e_N = P(g - v), shape (nv,).
        damped: Whether a singular value was below the threshold, so that the law was
            bounded rather than exact.
        finite: Whether a is made of numbers.
    """

    acceleration: Array
    null_space_error: Array
    damped: bool
    finite: bool


class Resolution:
    """The law for levels of tasks: the kernels with their buffers.

    It has scratch but nothing that it remembers: the same input gives the same output.

    Attributes:
        problem: What is to be resolved, to be filled in before `resolve`.
        ends: Where each level's rows end in the stack.
        threshold: Singular value below which the inverse is bounded.
        null_space_error: e_N of the last `resolve`, shape (nv,).
    """

    def __init__(
        self, levels: Sequence[int], nv: int, form: int, gain: Array, threshold: float
    ) -> None:
        """Allocate.

        Args:
            levels: Rows of each level, the highest priority first.
            nv: Freedoms.
            form: The metric's form.
            gain: Null-space gain K_N, shape (nv, nv) [1/s].
            threshold: Singular value of the whitened Jacobian below which it is damped.
        """
        m = sum(levels)
        self.problem = Problem(m, nv, gain)
        self.ends: Indices = np.cumsum([*levels] or [0], dtype=np.int64)
        self._form = form
        self.threshold = threshold
        self._scratch = np.zeros(_scratch_size(m, nv))
        self._a, self.null_space_error = np.zeros(nv), np.zeros(nv)
        self._bound: tuple[Array | None, bool] = None, True

    def resolve(self, v: Array, *, controls_null_space: bool = True) -> Resolved:
        """Return the acceleration that tracks the tasks and the field.

        Args:
            v: Velocity, shape (nv,).
            controls_null_space: False for φ_N = 0, the paper's first simulation.
        """
        if v is not self._bound[0] or controls_null_space is not self._bound[1]:
            self._bound = v, controls_null_space
            self._law = bind(
                _resolve,
                self.problem.block,
                v,
                self.ends,
                self._form,
                self.threshold,
                controls_null_space,
                self._scratch,
                self.null_space_error,
                self._a,
            )
        damped, finite = self._law()
        return Resolved(self._a, self.null_space_error, damped, finite)

    def singular_values(self, first: int = 0) -> Array:
        """Return the singular values of J L⁻ᵀ from a row on, largest first.

        Their product squared is det(J W⁻¹ Jᵀ), the manipulability of the paper.
        """
        J = self.problem.task.jacobian[first:]
        values = np.zeros(min(J.shape))
        _singular_values(J, self.problem.metric.L, self._form, self._scratch, values)
        return values


@kernel
def _scratch_size(m: int, n: int) -> int:
    return n * n + 3 * n * m + 3 * m * m + 5 * max(m, n) + n


@kernel
def _resolve(
    block: Array,
    v: Array,
    ends: Indices,
    form: int,
    threshold: float,
    controls: bool,
    scratch: Array,
    e_N: Array,
    a: Array,
) -> tuple[bool, bool]:
    """Write e_N and a; return whether it was damped, and whether a is finite."""
    m, n = ends[-1], v.shape[0]
    J, J_dot, _, _, a_x, g, g_dot, W, L, W_dot, K_N = parts(block, m, n)
    mn, mm, wide = m * n, m * m, max(m, n)
    at = 3 * mn + 3 * mm
    J_sharp = scratch[:mn].reshape(n, m)
    B = scratch[mn : 2 * mn].reshape(n, m)
    Q = scratch[2 * mn : 3 * mn].reshape(n, m)
    R = scratch[3 * mn : 3 * mn + mm].reshape(m, m)
    V = scratch[3 * mn + mm : 3 * mn + 2 * mm].reshape(m, m)
    vectors = scratch[at : at + 5 * wide].reshape(5, wide)
    u = scratch[at + 5 * wide : at + 5 * wide + n]

    conflicting = m > n
    damped = False
    if not conflicting:
        damped = weighted_pseudo_inverse(J, L, form, threshold, B, Q, R, V, J_sharp)
        conflicting = damped and ends.shape[0] > 1
    if conflicting:
        square = scratch[3 * mn : 3 * mn + 2 * mm].reshape(2, m, m)
        G_inverse = scratch[3 * mn + 2 * mm : 3 * mn + 3 * mm].reshape(m, m)
        inner = scratch[at + 5 * wide + n :].reshape(n, n)
        damped = resolve_levels(
            J,
            J_dot,
            a_x,
            v,
            g,
            g_dot,
            K_N,
            W,
            L,
            W_dot,
            form,
            threshold,
            controls,
            ends,
            inner,
            B,
            G_inverse,
            square,
            vectors,
            e_N,
            a,
        )
    else:
        null_space_command(
            J, J_dot, J_sharp, v, g, g_dot, K_N, W, L, W_dot, form, vectors, e_N, u
        )
        if not controls:
            for i in range(n):
                u[i] = 0.0
        acceleration(J, J_dot, J_sharp, v, a_x, u, vectors, a)
    total = 0.0
    for i in range(n):
        total += a[i]
    return damped, bool(np.isfinite(total))


@kernel
def _singular_values(
    J: Array, L: Array, form: int, scratch: Array, values: Array
) -> None:
    """Write the singular values of J L⁻ᵀ, largest first; J of any shape."""
    m, n = J.shape
    columns = scratch[: m * n].reshape(n, m)
    for k in range(m):
        for i in range(n):
            columns[i, k] = J[k, i]
        if form != IDENTITY:
            solve_lower(L, columns[:, k])
    V = scratch[m * n : m * n + m * m].reshape(m, m)
    orthogonalise_columns(columns, V)
    squares = scratch[m * n : m * n + m]
    for k in range(m):
        squares[k] = 0.0
        for i in range(n):
            squares[k] += columns[i, k] * columns[i, k]
    for rank in range(values.shape[0]):
        best = rank
        for k in range(rank + 1, m):
            if squares[k] > squares[best]:
                best = k
        squares[rank], squares[best] = squares[best], squares[rank]
        values[rank] = np.sqrt(squares[rank])
