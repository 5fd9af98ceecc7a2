"""A smooth change of a task's gains."""

import numpy as np

from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task
from hsp_control.trajectories.schedule import Schedule


class GainRamp:
    """Kp(t) = (1 - w) Kp_0 + w Kp_1, Kv alike, w(t) from 0 to 1.

    The error equation holds at every instant with the gains of that instant.
    """

    def __init__(self, task: Task, gains: Gains, start: float, ramp: float) -> None:
        """Start from the present gains of the task.

        Args:
            task: The task; `apply` changes its Kp and Kv in place.
            gains: The new gains, Kp_1 and Kv_1.
            start: Start of the ramp [s].
            ramp: Duration of the ramp ≥ 0 [s].

        Raises:
            GainError: If the gains do not fit the task.
            ScheduleError: If the ramp is negative.
        """
        self._task = task
        self._from = task.Kp.copy(), task.Kv.copy()
        self._to = gains.matrices(task.rows)
        self._end = start + ramp
        self._schedule = Schedule([(start, np.inf)], ramp=ramp)

    def apply(self, t: float) -> bool:
        """Set the task's gains for time t [s]; return whether the ramp is over."""
        w = self._schedule.weight(t)
        self._task.Kp[:] = (1.0 - w) * self._from[0] + w * self._to[0]
        self._task.Kv[:] = (1.0 - w) * self._from[1] + w * self._to[1]
        return t >= self._end
