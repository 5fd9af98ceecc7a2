"""From tasks and a field to one acceleration: the law, its memory and its numbers."""

from typing import NamedTuple

import numpy as np

from hsp_control.arrays import Array
from hsp_control.fields import FieldSample
from hsp_control.kernels import kernel
from hsp_control.linalg import orthogonalise_columns
from hsp_control.metrics import MetricSample
from hsp_control.resolution.law import acceleration, null_space_command
from hsp_control.resolution.pseudo_inverse import weighted_pseudo_inverse
from hsp_control.tasks import TaskSample


class Resolved(NamedTuple):
    """What the law decided at one state.

    Attributes:
        acceleration: a, shape (nv,).
        null_space_error: e_N = (I - J#J)(g - v), shape (nv,).
        damped: Whether a singular value was below the threshold, so that the law was
            bounded rather than exact.
    """

    acceleration: Array
    null_space_error: Array
    damped: bool


class Resolution:
    """The law for one stack of tasks: `law.py` with its buffers.

    It has scratch but no memory: the same input gives the same output.
    """

    def __init__(
        self, rows: int, nv: int, form: int, gain: Array, threshold: float
    ) -> None:
        """Allocate.

        Args:
            rows: Rows m of all tasks.
            nv: Freedoms.
            form: The metric's form.
            gain: Null-space gain K_N, shape (nv, nv) [1/s].
            threshold: Singular value of the whitened Jacobian below which it is damped.
        """
        self._form = form
        self._gain = gain
        self._threshold = threshold
        self.pseudo_inverse: Array = np.zeros((nv, rows))
        self._B, self._Q = np.zeros((nv, rows)), np.zeros((nv, rows))
        self._R, self._V = np.zeros((rows, rows)), np.zeros((rows, rows))
        self._scratch = np.zeros((5, nv))
        self._u, self._a = np.zeros(nv), np.zeros(nv)
        self.null_space_error: Array = np.zeros(nv)

    def resolve(
        self,
        task: TaskSample,
        v: Array,
        field: FieldSample,
        metric: MetricSample,
        *,
        controls_null_space: bool,
    ) -> Resolved:
        """Return the acceleration that tracks the tasks and the field.

        Args:
            task: All tasks stacked.
            v: Velocity, shape (nv,).
            field: g and g'.
            metric: W, L and W'.
            controls_null_space: False for φ_N = 0, the paper's first simulation.
        """
        damped = _resolve(
            task.jacobian,
            task.jacobian_dot,
            task.acceleration,
            v,
            *field,
            self._gain,
            *metric,
            self._form,
            self._threshold,
            controls_null_space,
            self._B,
            self._Q,
            self._R,
            self._V,
            self._scratch,
            self.pseudo_inverse,
            self.null_space_error,
            self._u,
            self._a,
        )
        return Resolved(self._a, self.null_space_error, damped)

    def singular_values(self) -> Array:
        """Return the singular values of J L⁻ᵀ at the last `resolve`, largest first.

        Their product squared is det(J W⁻¹ Jᵀ), the manipulability of the paper.
        """
        columns = self._B.copy()
        orthogonalise_columns(columns, self._V)
        return np.asarray(np.sort(np.sqrt((columns**2).sum(axis=0)))[::-1])


@kernel
def _resolve(
    J: Array,
    J_dot: Array,
    a_x: Array,
    v: Array,
    g: Array,
    g_dot: Array,
    K_N: Array,
    W: Array,
    L: Array,
    W_dot: Array,
    form: int,
    threshold: float,
    controls_null_space: bool,
    B: Array,
    Q: Array,
    R: Array,
    V: Array,
    scratch: Array,
    J_sharp: Array,
    e_N: Array,
    u: Array,
    a: Array,
) -> bool:
    """Write e_N and a; return whether the pseudo-inverse was damped."""
    damped = weighted_pseudo_inverse(J, L, form, threshold, B, Q, R, V, J_sharp)
    null_space_command(
        J, J_dot, J_sharp, v, g, g_dot, K_N, W, L, W_dot, form, scratch, e_N, u
    )
    if not controls_null_space:
        for i in range(u.shape[0]):
            u[i] = 0.0
    acceleration(J, J_dot, J_sharp, v, a_x, u, scratch, a)
    return damped
