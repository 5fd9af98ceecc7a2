"""A task's gains on their way to others."""

import numpy as np

from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task
from hsp_control.trajectories.schedule import Schedule


class GainRamp:
    """Kp and Kv of a task, from what they are to what they shall be.

    The error equation holds with the gains of each instant.
    """

    def __init__(self, task: Task, gains: Gains, start: float, ramp: float) -> None:
        """Set the ramp; it starts at ``start`` and lasts ``ramp`` [s].

        Raises:
            GainError: If the gains do not fit the task.
            ScheduleError: If the ramp is negative.
        """
        self._task = task
        self._from = task.Kp.copy(), task.Kv.copy()
        self._to = gains.matrices(task.rows)
        self._end = start + ramp
        self._share = Schedule([(start, np.inf)], ramp=ramp)

    def apply(self, t: float) -> bool:
        """Set the gains of time t [s]; return whether they have arrived."""
        w = self._share.weight(t)
        self._task.Kp[:] = (1.0 - w) * self._from[0] + w * self._to[0]
        self._task.Kv[:] = (1.0 - w) * self._from[1] + w * self._to[1]
        return t >= self._end
