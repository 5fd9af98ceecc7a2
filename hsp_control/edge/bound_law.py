"""The law with its edge and its memory: from tasks and a field to an acceleration.

The mathematics is in the engine: ``engine/law`` is the theorem, ``engine/edge`` the
bounds where tasks cannot be met.
"""

from collections.abc import Sequence

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.edge.step import ByLevels, EdgeMemory, Factors, Projectors
from hsp_control.edge.threshold import NOT, Following, Thresholds
from hsp_control.engine.plans import OnlyIf, PartCall
from hsp_control.law.outcome import LawOutcome
from hsp_control.law.problem import Problem


class BoundLaw:
    """The law for levels of tasks: its calls and their memory.

    It has scratch memory but no state: the same input gives the same output.

    Attributes:
        problem: The input, to be written before `call` is made.
        ends: Ends of the levels' rows in the stack.
        form: The metric's form.
        threshold: ε_0, the singular value below which the inverse is always bounded.
        thresholds: ε of each level, of the last `call`, shape (levels,).
        units: Of the singular values, for each row, shape (m,); see `Thresholds`.
        acceleration: a of the last `call`, shape (nv,).
        null_space_error: e_N of the last `call`, shape (nv,).
        outcome: The outcome of the law then.
        edge: The results of the damped and the exact law then.
        edge_level: The first level whose inverse the damped law bounds, from 1 on,
            shape (1,); 0: none, or the damped law is not computed.
        factors: The stack's pseudo-inverse then.
        alone: Whether the tasks of one level are always resolved at once.
        projectors: The levels' projectors then, if the damped law bounds an inverse and
            the level is not alone.
    """

    def __init__(
        self,
        levels: Sequence[int],
        nv: int,
        form: int,
        gain: Array,
        threshold: float,
        following: Following = NOT,
        *,
        parts: Sequence[int] | None = None,
        controls: bool = True,
    ) -> None:
        """Allocate.

        Args:
            levels: Number of rows of each level, m in all.
            nv: Degrees of freedom.
            form: The metric's form.
            gain: K_N, shape (nv, nv) [1/s].
            threshold: ε_0.
            following: What thresholds follow.
            parts: Number of rows of each part of an error, such as a position; None:
                each level is one part.
            controls: Whether there is a field; without one u = 0.
        """
        m = sum(levels)
        self.problem = Problem(m, nv, gain, np.cumsum([*(parts or levels)] or [0]))
        self.ends: Indices = np.cumsum([*levels] or [0], dtype=np.int64)
        self.form = form
        self.threshold, self._following = threshold, following
        self._controls = controls
        self._thresholds = Thresholds.allocate(len(self.ends), m)
        self.thresholds, self.units = self._thresholds.own, self._thresholds.units
        self.thresholds[:] = threshold
        self.factors = Factors(np.zeros((m, nv)), np.zeros((m, m)))
        self.projectors = Projectors.allocate(m, nv)
        self.edge = EdgeMemory.allocate(m, nv)
        self.edge_level: Indices
        self.edge_level, self._left_out = np.zeros((2, 1), dtype=np.int64)
        self._self_motions, self._brakings = np.zeros((2, 2, nv))
        # Only a fixed base uses both laws. A robot on feet keeps its balance by tasks
        # that must not be damped.
        legs = following.modest > 0.0
        self._exact_beside = following.size > 0.0 and m <= nv and not legs
        # A conflict needs two levels, or more rows than degrees of freedom.
        self.alone = len(self.ends) == 1 and m <= nv
        self.acceleration = self.problem.record.acceleration
        self.null_space_error = self.problem.record.null_space_error
        self.outcome = LawOutcome.allocate()

    def call(self, v: Array, *, beside: bool = False) -> PartCall:
        """Return the call that writes a, e_N and the outcome.

        Args:
            v: Velocity, shape (nv,).
            beside: Whether the damped law is written even where its share is zero.
        """
        problem = self.problem
        law = {
            "task": problem.task,
            "field": problem.field,
            "metric": problem.metric,
            "form": self.form,
            "v": v,
            "K_N": problem.gain,
            "controls": self._controls,
        }
        return PartCall(
            engine.Resolve,
            law=law,
            rows={"ends": self.ends, **problem.rows},
            least=self.threshold,
            following=self._following,
            exact_beside=self._exact_beside,
            alone=self.alone,
            beside=beside,
            thresholds=self._thresholds,
            factors=self.factors,
            projectors=self.projectors,
            edge=self.edge,
            e_N=self.null_space_error,
            a=self.acceleration,
            edge_level=self.edge_level,
            left_out=self._left_out,
            outcome=self.outcome,
        )

    def damped_beside(self, v: Array) -> OnlyIf:
        """Return a call that writes the damped law if `call` omitted it; a is kept."""
        return OnlyIf([self.call(v, beside=True)], self._left_out)

    def self_motions(self, v: Array) -> tuple[PartCall, tuple[Array, Array]]:
        """Return the call that writes the null space's contributions, after `call`.

        Args:
            v: Velocity, shape (nv,).

        Returns:
            The call, and its results: φ_N of a and of a_damped, shape (2, nv), and
            their damping P K_N P v, shape (2, nv).
        """
        task, metric = self.problem.task, self.problem.metric
        written = self._self_motions, self._brakings
        call = PartCall(
            engine.SelfMotions,
            J=task.jacobian,
            J_dot=task.jacobian_dot,
            a_x=task.acceleration,
            W=metric.W,
            L=metric.L,
            form=self.form,
            v=v,
            K_N=self.problem.gain,
            alone=self.alone,
            factors=self.factors,
            Q_K=self.projectors.Q,
            edge=self.edge,
            edge_level=self.edge_level,
            a=self.acceleration,
            self_motions=self._self_motions,
            brakings=self._brakings,
        )
        return call, written

    def by_levels(self, v: Array) -> tuple[PartCall, ByLevels]:
        """Return the call that writes the levels' contributions, after `self_motions`.

        Args:
            v: Velocity, shape (nv,).

        Returns:
            The call, and its results.
        """
        task, demand = self.problem.task, self.problem.demand
        shape, m = (len(self.ends), len(v)), len(demand)
        factors = Factors(np.zeros((m, len(v))), np.zeros((m, m)))
        written = ByLevels(np.zeros(shape), np.zeros(shape), factors)
        call = PartCall(
            engine.ByLevels,
            J=task.jacobian,
            J_dot=task.jacobian_dot,
            a_x=task.acceleration,
            demand=demand,
            L=self.problem.metric.L,
            form=self.form,
            v=v,
            projectors=self.projectors,
            ends=self.ends,
            edge_level=self.edge_level,
            a=self.acceleration,
            self_motion=self._self_motions[0],
            **written._asdict(),
        )
        return call, written

    def diagnosis(self, first: int) -> tuple[PartCall, Array, Array]:
        """Return a call that computes the law's distance from singularity and rest.

        Args:
            first: The first row of the tasks: those before it belong to contacts.

        Returns:
            The call, which returns det(J W⁻¹ Jᵀ) without the rows before ``first``, the
            paper's manipulability; and its results: the argument of `singular_values`,
            and ‖e_N‖_W, the square root of 2 V, shape (1,).
        """
        J, metric = self.problem.task.jacobian[first:], self.problem.metric
        smaller = min(J.shape)
        T, length = np.zeros((smaller, smaller)), np.zeros(1)
        call = PartCall(
            engine.Diagnose,
            J=J,
            W=metric.W,
            L=metric.L,
            form=self.form,
            e_N=self.null_space_error,
            T=T,
            length=length,
        )
        return call, T, length
