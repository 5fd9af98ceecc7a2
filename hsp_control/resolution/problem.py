"""The numbers of one step in one block of memory, which a kernel takes as one argument.

Numba spends about 0.1 µs on every array that it is handed; the law has twenty.
"""

import numpy as np

from hsp_control.arrays import Array
from hsp_control.fields import FieldSample
from hsp_control.kernels import kernel, uncompiled
from hsp_control.metrics import MetricSample
from hsp_control.tasks import TaskSample


@kernel
def parts(
    block: Array, m: int, n: int
) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array, Array, Array, Array]:
    """Return what the law reads, and the two vectors it writes, as views of a block.

    In order: J, J' (m, n); e, e', a_x (m,); g, g' (n,); W, L, W', K_N (n, n).
    """
    mn, nn = m * n, n * n
    at = 2 * mn + 3 * m + 2 * n
    return (
        block[:mn].reshape(m, n),
        block[mn : 2 * mn].reshape(m, n),
        block[2 * mn : 2 * mn + m],
        block[2 * mn + m : 2 * mn + 2 * m],
        block[2 * mn + 2 * m : 2 * mn + 3 * m],
        block[2 * mn + 3 * m : 2 * mn + 3 * m + n],
        block[2 * mn + 3 * m + n : at],
        block[at : at + nn].reshape(n, n),
        block[at + nn : at + 2 * nn].reshape(n, n),
        block[at + 2 * nn : at + 3 * nn].reshape(n, n),
        block[at + 3 * nn : at + 4 * nn].reshape(n, n),
    )


@kernel
def block_size(m: int, n: int) -> int:
    """Return how many numbers `parts` divides."""
    return 2 * m * n + 3 * m + 2 * n + 4 * n * n


class Problem:
    """What the law is asked at one state; tasks, field and metric write into it.

    Attributes:
        block: All of it.
        task: All tasks, level after level: J, J', e, e', a_x.
        field: g and g'.
        metric: W, its Cholesky factor and W'; the identity until it is written.
        gain: K_N, shape (nv, nv) [1/s].
    """

    def __init__(self, rows: int, nv: int, gain: Array) -> None:
        """Allocate for a number of rows and of freedoms."""
        self.block: Array = np.zeros(block_size(rows, nv))
        views = uncompiled(parts)(self.block, rows, nv)
        self.task = TaskSample(*views[:5])
        self.field = FieldSample(*views[5:7])
        self.metric = MetricSample(*views[7:10])
        self.gain = views[10]
        self.metric.W[:] = self.metric.L[:] = np.eye(nv)
        self.gain[:] = gain
