"""The input of the law: tasks, field and metric write it, the law reads it."""

from hsp_control.common.arrays import Array
from hsp_control.null_space.fields import FieldSample
from hsp_control.null_space.metrics import MetricSample
from hsp_control.tasks import TaskSample


class Problem:
    """The input of the law at one state.

    Attributes:
        task: All tasks, level after level: J, J', e, e', a_x.
        field: g and g'.
        metric: W, its Cholesky factor and W'; the identity until it is written.
        gain: K_N, shape (nv, nv) [1/s].
    """

    def __init__(self, rows: int, nv: int, gain: Array) -> None:
        """Allocate for a number of rows and of degrees of freedom."""
        self.task = TaskSample.allocate(rows, nv)
        self.field = FieldSample.allocate(nv)
        self.metric = MetricSample.allocate(nv)
        self.gain = gain.copy()
