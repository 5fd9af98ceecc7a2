"""Tasks that fade: a step per set of them, and the mean of some.

A frozen plan has the calls of every set of the tasks whose presence is an input; a step
makes those of the sets that have a share, as `Mixture` does.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import FreezeError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation.actuation import Actuation
from hsp_control.control.actuation.delivered import DeliveredAlone
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.controller import Controller
from hsp_control.declaration import within
from hsp_control.declaration.language import spoken
from hsp_control.engine import Plan
from hsp_control.engine.plans import AnyCall, PartCall, Step
from hsp_control.tasks.compliant_task import impedance_of

MOST = 4
"""Largest number of tasks whose presence is an input: the file has 2^MOST sets."""


Delivering = Callable[[ActiveStack, Actuation, DeliveredAlone], list[Step]]
"""Returns the calls that deliver the law of a stack into the given arrays."""


class TaskErrors(NamedTuple):
    """e and e' of a task in the last step that had it."""

    error: Array
    error_rate: Array


class Reported(NamedTuple):
    """The reports of a step on its tasks."""

    errors: Mapping[str, TaskErrors]
    """By the tasks' names."""
    damped_level: Indices
    """The first level with a bounded inverse, shape (1,); 0: none."""


def reported(own: Controller, bound: BoundStep) -> Reported:
    """Return where a step whose tasks are always present writes this."""
    active, errors = bound.active, {}
    for task in own.tasks:
        here = active.task_rows[task.name]
        rows = active.rows.error[here], active.rows.error_rate[here]
        errors[task.name] = TaskErrors(*rows)
    return Reported(errors, active.law.outcome.damped_level)


class TaskSets:
    """The sets of tasks, and their mean.

    Attributes:
        names: The tasks that come and go.
        presences: Their presences, in [0, 1], shape (k,).
        reported: The reports of a step on all tasks.
    """

    def __init__(self, own: Controller, bound: BoundStep, names: Sequence[str]) -> None:
        """Bind the common calls of all sets.

        Args:
            own: The controller.
            bound: Its step, with all tasks.
            names: The tasks that come and go.

        Raises:
            FreezeError: If there is no such task, one of them has an impedance, or they
                are too many.
        """
        _check(own, names)
        self.names = tuple(names)
        self.presences = np.ones(len(names))
        self._own, self._bound = own, bound
        errors = {
            name: TaskErrors(each.error.copy(), each.error_rate.copy())
            for name, each in reported(own, bound).errors.items()
        }
        self.reported = Reported(errors, np.zeros(1, dtype=np.int64))

    def calls(self, delivered: DeliveredAlone, deliver: Delivering) -> list[Step]:
        """Return the calls of a step after those of the state.

        Args:
            delivered: The arrays of the result.
            deliver: Returns the calls for the law of one set.
        """
        state, nv = self._bound.state, len(delivered.a)
        count = 1 << len(self.names)
        on, shares = np.zeros(count, dtype=np.int64), np.zeros(count)
        accelerations, efforts = np.zeros((2, count, nv))
        statuses, finite, levels = np.zeros((3, count), dtype=np.int64)
        # Bit k of a set's index is whether it has task k.
        members = np.arange(count)[:, None] >> np.arange(len(self.names)) & 1
        choose = PartCall(
            engine.ChooseSets,
            lows=np.zeros(len(self.names)),
            highs=self.presences,
            members=members,
            on=on,
            shares=shares,
        )
        steps = state.plan([choose]).steps()
        for s, left in enumerate(product((False, True), repeat=len(self.names))):
            has = dict(zip(self.names, reversed(left), strict=True))
            one = slice(s, s + 1)
            part = DeliveredAlone(
                accelerations[s], efforts[s], statuses[one], finite[one]
            )
            active, actuation = self._own.stack_alone([x for x in has if not has[x]])
            made = [*active.calls, *deliver(active, actuation, part)]
            made += self._report(active, levels[one])
            steps.append(engine.OnlyIf(calls=Plan(made), condition=on[one]))
        mix = PartCall(
            engine.MixSets,
            on=on,
            shares=shares,
            accelerations=accelerations,
            efforts=efforts,
            statuses=statuses,
            finite=finite,
            levels=levels,
            damped_level=self.reported.damped_level,
            **delivered._asdict(),
        )
        return [*steps, *state.plan([mix]).steps()]

    def _report(self, active: ActiveStack, level: Indices) -> list[Step]:
        """Return the calls that store the reports of a set on its tasks."""
        calls = list[AnyCall]()
        for name, here in active.task_rows.items():
            there = self.reported.errors[name]
            for rows, out in (
                (active.rows.error, there.error),
                (active.rows.error_rate, there.error_rate),
            ):
                calls.append(PartCall(engine.Copy, x=rows[here], out=out))
        damped = active.law.outcome.damped_level
        calls.append(PartCall(engine.KeepLevel, level=damped, kept=level))
        return self._bound.state.plan(calls).steps()


def _check(own: Controller, names: Sequence[str]) -> None:
    tasks = {task.name: task for task in own.tasks}
    with within(spoken("--presence", "presences")):
        for k, name in enumerate(names):
            if name not in tasks:
                raise FreezeError(
                    f"there is no task {name!r}{did_you_mean(name, tasks)}"
                )
            if name in names[:k]:
                raise FreezeError(f"task {name!r} is named twice")
            if impedance_of(tasks[name]) is not None:
                raise FreezeError(
                    f"task {name!r} has an impedance, whose ramps wait for the power "
                    "of its error, also while it is absent: its stiffness is an input"
                )
        if len(names) > MOST:
            raise FreezeError(
                f"there are {len(names)}; at most {MOST} tasks may come and go: each "
                "doubles the file"
            )
