"""Integral action: e'' + Kv e' + Kp e + Ki ∫e = 0."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, field
from typing import Annotated

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import CompensationError, GainError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.common.warned import warn
from hsp_control.control.actuation import Status
from hsp_control.control.compensation.stage import Alone, AloneCalls, Run, Stage
from hsp_control.control.controller import Controller
from hsp_control.control.first_state import StartWarning
from hsp_control.control.measurement import LogChannel
from hsp_control.control.planned import PlannedTask
from hsp_control.control.task_names import TaskNames
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import (
    READ_ONLY,
    Gain,
    Names,
    Positive,
    ReadOnlyDict,
)
from hsp_control.engine.plans import PartCall, planned
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.gains import as_gain, as_matrix


class IntegralAction(Part, error=CompensationError):
    """Removes the steady-state errors of tasks; it has no effect in the null space.

    Anti-windup: while the law is not delivered exactly (a limit binds, a singularity
    bounds the law, the start-up ramp is active), the integral may only decrease.

    A robot heavier than its model performs only a part β of the acceleration that the
    law requires: e'' + β (Kv e' + Kp e + Ki ∫e) = d. Its error grows if β < Ki/(Kv Kp)
    (Routh). `check_rate` reports this in advance.
    """

    rate: Positive | None = None
    """Rate at which a constant error decays [1/s]: Ki = rate · Kp, for tasks that `ki`
    does not name."""
    _: KW_ONLY
    ki: Annotated[Mapping[str, Gain], READ_ONLY] = field(default_factory=ReadOnlyDict)
    """Ki by task name [1/s³]: a number, one per row, or a matrix."""
    tasks: Names | None = None
    """Names of the tasks with integral action [-]; all by default."""
    limit: Positive | None = None
    """Largest acceleration from the integral in a row [m/s² or rad/s²]; unlimited by
    default."""

    def __post_init__(self) -> None:
        """Check that there is a rate or a gain."""
        if self.rate is None and not self.ki:
            raise CompensationError("integral action needs a rate [1/s], or ki by task")

    def gains(self, tasks: Sequence[Task]) -> dict[str, Array]:
        """Return Ki, shape (m, m), of the tasks with integral action."""
        names = [task.name for task in tasks]
        named = [("ki", name) for name in self.ki]
        named += [("tasks", name) for name in self.tasks or ()]
        for key, name in named:
            if name not in names:
                with within(key):
                    raise CompensationError(
                        f"there is no task {name!r}{did_you_mean(name, names)} "
                        f"(there are {listing(names)})"
                    )
        gains = {task.name: self.gain(task) for task in tasks}
        return {name: Ki for name, Ki in gains.items() if Ki is not None}

    def gain(self, task: Task) -> Array | None:
        """Return Ki of a task, shape (m, m); None: it has no integral action.

        Raises:
            CompensationError: If its error equation permits none.
            GainError: If its error would not decay.
        """
        if self.tasks is not None and task.name not in self.tasks:
            return None
        if impedance_of(task) is not None:
            raise CompensationError(
                f"task {task.name!r} has an impedance: integral action would press "
                "against the external force; list the other tasks in tasks"
            )
        if task.name in self.ki:
            with within("ki", task.name):
                Ki = as_matrix(as_gain(self.ki[task.name], "Ki"), task.rows, "Ki")
        elif self.rate is not None:
            Ki = self.rate * task.feedback().Kp
        else:
            return None
        if task.order == 1:
            raise CompensationError(
                f"task {task.name!r} has a first-order error equation; list the "
                "other tasks in tasks"
            )
        _check_decay(task, Ki)
        return Ki


class RunningIntegral(Stage):
    """Integral action in one run: it keeps the integrals.

    By the keys of tasks, of which two may have one name while they fade. A task that a
    change adds has integral action, too; where its error equation permits none, a
    warning says so.

    Attributes:
        integrals: ∫e by task, shape (m,) [m·s or rad·s].
    """

    _bound: dict[int, tuple[Array, Callable[[], object]]] | None = None

    def __init__(self, declared: IntegralAction, controller: Controller) -> None:
        self._declared, self._controller = declared, controller
        self._limit = np.inf if declared.limit is None else declared.limit
        self._gains: dict[int, Array | None] = {}
        self.integrals: dict[int, Array] = {}
        self._names = TaskNames()
        declared.gains(controller.tasks)  # raises if one of these permits none
        self._follow()
        self._period, self._hindered = np.zeros(1), np.zeros(1, dtype=np.int64)

    def _follow(self) -> dict[int, PlannedTask]:
        """Begin with the tasks that are new, forget those that are gone; return all."""
        levels = self._controller.planned_levels
        present = {each.key: each for level in levels for each in level}
        if present.keys() == self._gains.keys():
            return present
        self._names.update(present.values())
        before, self._gains = self._gains, {}
        for key, each in present.items():
            self._gains[key] = before.get(key)
            if key not in before:
                self._gains[key] = self._gain_of_new(each.task)
        self.integrals = {
            key: self.integrals.get(key, np.zeros(len(Ki)))
            for key, Ki in self._gains.items()
            if Ki is not None
        }
        bound = self._bound or {}
        self._bound = {key: bound[key] for key in bound if key in self.integrals}
        return present

    def _gain_of_new(self, task: Task) -> Array | None:
        """Return Ki; None, with a warning, if its error equation permits none."""
        try:
            return self._declared.gain(task)
        except (CompensationError, GainError) as error:
            name = f"task {task.name!r}"
            why = str(error).removeprefix(f"{name} ")
            warn(f"{name} begins without integral action: {why}", StartWarning)
            return None

    def finish(self, run: Run) -> None:
        """Integrate the errors of the fully active tasks; see `Stage.finish`."""
        present, t = self._follow(), self._controller.state.t
        output, active = run.output, self._controller.active_stack
        limited = output.status >= Status.LIMITED
        errors = {
            key: output.task.error[each.rows]
            for each in active.stacked
            if (key := each.planned.key) in present and present[key].weight(t) >= 1.0
        }
        saturated = bool(output.damped) or limited or run.starting
        self.advance(errors, run.period, saturated)

    def alone(self, shared: Alone) -> AloneCalls:
        """Return the integrals; see `Stage.alone`."""
        stack = self._controller.active_stack
        given = shared.period, shared.damped, shared.status, shared.starting
        own = [
            self._call(each.planned.key, stack.rows.error[each.rows], *given)
            for each in stack.stacked
            if each.planned.key in self.integrals
        ]
        return AloneCalls(finish=own)

    def _call(
        self,
        key: int,
        e: Array,
        period: Array,
        damped: Indices,
        status: Indices,
        starting: Indices,
    ) -> PartCall:
        """Return the call that integrates the error of a task."""
        return PartCall(
            engine.IntegrateError,
            e=e,
            Ki=self._gains[key],
            limit=self._limit,
            period=period,
            damped=damped,
            status=status,
            starting=starting,
            limited=int(Status.LIMITED),
            integral=self.integrals[key],
            offset=self._controller.offset(key),
        )

    def log_channels(self, run: Run) -> Mapping[str, LogChannel]:
        """Return the integrals; see `Stage.log_channels`."""
        names = self._names.present
        return {
            f"task.{names[key]}.integral": LogChannel(integral, "m·s or rad·s", "∫e")
            for key, integral in self.integrals.items()
        }

    def advance(
        self, errors: Mapping[int, Array], period: float, saturated: bool
    ) -> None:
        """Integrate the errors, by task, over one period, for the next effort."""
        self._period[:], self._hindered[:] = period, saturated
        for key in self.integrals:
            if key in errors:
                e, integrate = self._integrating(key)
                e[:] = errors[key]
                integrate()

    def _integrating(self, key: int) -> tuple[Array, Callable[[], object]]:
        """Return the error that the call integrates, and the call."""
        if self._bound is None:
            self._bound = {}
        if key not in self._bound:
            e, never = np.zeros(len(self.integrals[key])), np.zeros(1, dtype=np.int64)
            call = self._call(key, e, self._period, never, never, self._hindered)
            self._bound[key] = e, planned([call]).call()
        return self._bound[key]


def _check_decay(task: Task, Ki: Array) -> None:
    m = task.rows
    Kp, Kv, *_ = task.feedback()
    zero, one = np.zeros((m, m)), np.eye(m)
    companion = np.block([[zero, one, zero], [zero, zero, one], [-Ki, -Kp, -Kv]])
    slowest = float(np.linalg.eigvals(companion).real.max())
    if slowest >= 0.0:
        # Per row (Routh): Ki < Kv Kp.
        bound = float((np.diag(Kv) * np.diag(Kp)).min())
        raise GainError(
            f"integral action of task {task.name!r} does not decay: e'' + Kv e' + "
            f"Kp e + Ki ∫e = 0 has a mode with real part {slowest:.3g} 1/s; Ki must be "
            f"below Kv Kp = {bound:.4g} 1/s³ (a rate below Kv = "
            f"{np.diag(Kv).min():.4g} 1/s)"
        )
