"""Integral action: e'' + Kv e' + Kp e + Ki ∫e = 0."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError, GainError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.control.compensation.checks import positive
from hsp_control.tasks import AngularMomentum, Task
from hsp_control.tasks.gains import as_gain, as_matrix


class IntegralAction:
    """A lasting error is worn away; the null space is not touched.

    While the law is not delivered as it is (a limit binds, a singularity bounds it, the
    effort's rate is cut, the start-up ramp runs), the integral only unwinds.

    A robot that is heavier than its model does but a part β of what the law asks for:
    e'' + β (Kv e' + Kp e + Ki ∫e) = d, whose error grows where β < Ki/(Kv Kp) (Routh).
    `check_rate` says so beforehand.

    Attributes:
        rate: Ki = rate · Kp, the rate at which a lasting error dies [1/s], for tasks
            that ``ki`` does not name; None: only those.
        ki: Ki by task: a number, one per row or a matrix [1/s³].
        tasks: Names of the tasks that have it; None: all.
        limit: The most that Ki ∫e may ask for in a row [m/s² or rad/s²].
    """

    def __init__(
        self,
        rate: float | None = None,
        *,
        ki: Mapping[str, Any] | None = None,
        tasks: Sequence[str] | None = None,
        limit: float = np.inf,
    ) -> None:
        """Set the action; see the attributes.

        Raises:
            CompensationError: If neither a rate nor a gain is given, or a number is not
                positive.
        """
        self.ki = dict(ki or {})
        if rate is None and not self.ki:
            raise CompensationError("integral action needs a rate [1/s], or ki by task")
        self.rate = None if rate is None else positive(rate, "rate")
        self.tasks = None if tasks is None else tuple(tasks)
        self.limit = positive(limit, "limit")

    def check(self, tasks: Sequence[Task]) -> None:
        """Refuse gains with which an error would not die.

        Raises:
            CompensationError: If a task does not exist or cannot have it.
            GainError: If a gain does not fit its task, or e''' + Kv e'' + Kp e' + Ki e
                = 0 has a mode that does not decay (for numbers: if Ki ≥ Kv Kp).
        """
        self.gains(tasks)

    def gains(self, tasks: Sequence[Task]) -> dict[str, Array]:
        """Return Ki of each task that has it, shape (m, m); raises as `check` does."""
        names = [task.name for task in tasks]
        for name in (*self.ki, *(self.tasks or ())):
            if name not in names:
                raise CompensationError(
                    f"integral_action: there is no task {name!r}"
                    f"{did_you_mean(name, names)} (there are {listing(names)})"
                )
        gains = {}
        for task in tasks:
            if self.tasks is not None and task.name not in self.tasks:
                continue
            if task.name in self.ki:
                what = f"ki of task {task.name!r}"
                Ki = as_matrix(as_gain(self.ki[task.name], what), task.rows, what)
            elif self.rate is not None:
                Ki = self.rate * task.Kp
            else:
                continue
            if isinstance(task, AngularMomentum):
                raise CompensationError(
                    f"integral_action: task {task.name!r} has an error equation of "
                    "first order; name the others in tasks"
                )
            _check_decay(task, Ki)
            gains[task.name] = Ki
        return gains

    def restart(self, tasks: Sequence[Task]) -> None:
        """Begin with no integral."""
        self._gains = self.gains(tasks)
        self._tasks = [task for task in tasks if task.name in self._gains]
        self.integrals: dict[str, Array] = {
            task.name: np.zeros(task.rows) for task in self._tasks
        }

    def advance(
        self, errors: Mapping[str, Array | None], period: float, bound: bool
    ) -> None:
        """Add a period's error; the next effort is the first to show it.

        Args:
            errors: e by task, shape (m,); None: the task does not count.
            period: How long it stands for [s].
            bound: Whether the law was not delivered as it is.
        """
        for task in self._tasks:
            integral, e = self.integrals[task.name], errors.get(task.name)
            if e is None:
                continue
            grows = e * integral >= 0.0 if bound else False
            integral += np.where(grows, 0.0, e) * period
            asked = self._gains[task.name] @ integral
            most = float(np.abs(asked).max(initial=0.0))
            if most > self.limit:
                integral *= self.limit / most
                asked *= self.limit / most
            task.offset[:] = asked


def _check_decay(task: Task, Ki: Array) -> None:
    m = task.rows
    zero, one = np.zeros((m, m)), np.eye(m)
    companion = np.block(
        [[zero, one, zero], [zero, zero, one], [-Ki, -task.Kp, -task.Kv]]
    )
    slowest = float(np.linalg.eigvals(companion).real.max())
    if slowest >= 0.0:
        # For each row by itself (Routh): Ki < Kv Kp.
        most = float((np.diag(task.Kv) * np.diag(task.Kp)).min())
        raise GainError(
            f"integral action of task {task.name!r} does not decay: e'' + Kv e' + "
            f"Kp e + Ki ∫e = 0 has a mode with real part {slowest:.3g} 1/s; Ki must be "
            f"below Kv Kp = {most:.4g} 1/s³ (a rate below Kv = "
            f"{np.diag(task.Kv).min():.4g} 1/s)"
        )
