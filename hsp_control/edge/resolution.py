"""The law with its edge and its buffers: from tasks and a field to an acceleration."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import KernelCall
from hsp_control.edge.blend import resolve_priorities, resolve_stack
from hsp_control.edge.self_motion import write_self_motions
from hsp_control.edge.step import EdgeMemory, Factors, LawStep, Projectors, Scratch
from hsp_control.edge.threshold import NOT, Following, Thresholds
from hsp_control.law.diagnosis import diagnose
from hsp_control.law.problem import Problem


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
        resolve = resolve_stack if self.alone else resolve_priorities
        return resolve, (self._step(v, controls),)

    def self_motions(self, v: Array) -> KernelCall:
        """Return the call that writes the parts of a and of a_damped, after `call`.

        It writes to `edge`.
        """
        return write_self_motions, (self._step(v, controls=True),)

    def _step(self, v: Array, controls: bool) -> LawStep:
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
        return (diagnose, given), T, length
