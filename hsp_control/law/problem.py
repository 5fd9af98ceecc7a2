"""The input of the law: tasks, field and metric write it, the law reads it."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.law.samples import FieldSample, MetricSample, TaskSample


class StepRecord(NamedTuple):
    """The quantities of a step, in one block of memory, so that one copy stores all.

    Attributes:
        task: All tasks, level after level: J, J', e, e', a_x.
        field: g and g'.
        null_space_error: e_N, shape (nv,).
        acceleration: a, shape (nv,).
        memory: The block, of which all of these are views.
    """

    task: TaskSample
    field: FieldSample
    null_space_error: Array
    acceleration: Array
    memory: Array

    @classmethod
    def allocate(cls, rows: int, nv: int) -> "StepRecord":
        """Return a record of zeros."""
        return cls.over(np.zeros(2 * rows * nv + 3 * rows + 4 * nv), rows, nv)

    @classmethod
    def over(cls, memory: Array, rows: int, nv: int) -> "StepRecord":
        """Return the record of m = ``rows`` rows; its arrays view ``memory``."""
        square, ends = rows * nv, 2 * rows * nv + 3 * rows
        vectors = memory[2 * square : ends].reshape(3, rows)
        joints = memory[ends:].reshape(4, nv)
        task = TaskSample(
            memory[:square].reshape(rows, nv),
            memory[square : 2 * square].reshape(rows, nv),
            *vectors,
        )
        return cls(
            task, FieldSample(joints[0], joints[1]), joints[2], joints[3], memory
        )


class Problem:
    """The input of the law at one state.

    Attributes:
        record: The memory of tasks, field and null-space error.
        task: All tasks, level after level: J, J', e, e', a_x.
        field: g and g'.
        metric: W, its Cholesky factor and W'; the identity until it is written.
        gain: K_N, shape (nv, nv) [1/s].
        parts: Ends of the rows of the parts of errors, such as a position's.
        demand: Kp s(e), the feedback's command at rest in the coordinates of e,
            shape (m,); zero in rows without one, such as those of contacts.
        yields: Weight with which the threshold of a row's level follows the row's
        demand, shape (m,): 0 without a bound on its error, so that it follows only
        below an unmet level; see `write_thresholds`.
        pulls: Force of a spring along a row over its largest force, shape (m,); 0 for
            other rows.
        stretched: Length of the part of the error to which a row belongs, over its
            largest length, shape (m,); 0 for rows without one.
        demands_known: Whether ``demand`` or ``pulls`` is written for every task.
        springs: Whether a row belongs to a spring, shape (m,). The law itself treats
            all rows alike; while limits are active, a spring yields like a body.
    """

    def __init__(self, rows: int, nv: int, gain: Array, parts: Indices) -> None:
        """Allocate for a number of rows and of degrees of freedom."""
        self.record = StepRecord.allocate(rows, nv)
        self.task = self.record.task
        self.field = self.record.field
        self.metric = MetricSample.allocate(nv)
        self.gain, self.parts = gain, parts
        self.demand = np.zeros(rows)
        self.yields = np.zeros(rows)
        self.pulls = np.zeros(rows)
        self.stretched = np.zeros(rows)
        self.springs = np.zeros(rows, dtype=np.bool_)
        self.demands_known = True

    @property
    def rows(self) -> dict[str, Array | Flags | Indices]:
        """The quantities of the rows, by name."""
        names = "parts", "demand", "yields", "pulls", "springs", "stretched"
        return {name: getattr(self, name) for name in names}
