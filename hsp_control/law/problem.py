"""The numbers of one step, which tasks, field and metric write and the law reads."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.null_space.fields import FieldSample
from hsp_control.null_space.metrics import MetricSample
from hsp_control.tasks import TaskSample


class Problem:
    """What the law is asked at one state.

    What has one shape lies in one array: a kernel takes it as one argument, and what it
    cuts off costs nothing.

    Attributes:
        task: All tasks, level after level: J, J', e, e', a_x.
        field: g and g'.
        metric: W, its Cholesky factor and W'; the identity until it is written.
        gain: K_N, shape (nv, nv) [1/s].
        arrays: The same memory by shape: J and J', (2, m, nv); e, e' and a_x, (3, m);
            g and g', (2, nv); W, L, W' and K_N, (4, nv, nv).
    """

    def __init__(self, rows: int, nv: int, gain: Array) -> None:
        """Allocate for a number of rows and of freedoms."""
        jacobians, tasks = np.zeros((2, rows, nv)), np.zeros((3, rows))
        field, squares = np.zeros((2, nv)), np.zeros((4, nv, nv))
        self.arrays = jacobians, tasks, field, squares
        self.task = TaskSample(*jacobians, *tasks)
        self.field = FieldSample(*field)
        self.metric = MetricSample(*squares[:3])
        self.gain: Array = squares[3]
        self.metric.W[:] = self.metric.L[:] = np.eye(nv)
        self.gain[:] = gain
