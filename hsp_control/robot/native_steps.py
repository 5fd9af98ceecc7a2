"""All steps of an interval of time as one native call."""

from hsp_control.common.adapters import run
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.robot.step_count import number_of_steps

_count = kernel(number_of_steps)


@kernel
def make_steps(
    calls: Indices, when: Array, interval: Array, longest: float, h: Array
) -> None:
    """Divide an interval into equal steps [s], and make the calls of each."""
    t, duration = interval[0], interval[1] - interval[0]
    steps = _count(duration, longest)
    h[0] = duration / steps
    for k in range(steps):
        run(calls, when, t + k * h[0])
