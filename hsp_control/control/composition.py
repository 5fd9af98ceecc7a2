"""Whether the parts of a controller belong together."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError, ControllerError, GainError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.constraints.contacts import Contact
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.metrics import Metric, MetricSample
from hsp_control.null_space.metrics.metric import VARYING
from hsp_control.robot import Robot
from hsp_control.tasks import Task
from hsp_control.tasks.gains import as_gain, as_matrix

Base = Literal["flying", "driven"]
"""What moves a free-flyer root where no contact does."""


def levels_of(tasks: Sequence[Task | Sequence[Task]]) -> tuple[tuple[Task, ...], ...]:
    """Return the tasks level by level; a plain list of tasks is one level.

    Raises:
        ControllerError: If tasks and lists of tasks are mixed.
    """
    single = [entry for entry in tasks if isinstance(entry, Task)]
    nested = [tuple(entry) for entry in tasks if not isinstance(entry, Task)]
    if single and nested:
        raise ControllerError(
            "tasks mixes tasks and lists of tasks; needs a list of tasks (one level) "
            "or a list of lists (one a level)"
        )
    return tuple(nested) if nested else (tuple(single),)


def check_parts(
    robot: Robot, levels: Sequence[Sequence[Task]], field: NullSpaceField
) -> None:
    """Refuse tasks and a field that are not one robot's, or too many.

    Raises:
        ControllerError: Names the culprit.
    """
    tasks = [task for level in levels for task in level]
    if not tasks or not all(levels):
        raise ControllerError("a controller needs at least one task, at every level")
    names = [task.name for task in tasks]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ControllerError(f"two tasks are called {twice[0]!r}; give them names")
    parts: list[Task | NullSpaceField] = [*tasks, field]
    for part in parts:
        if part.robot is not robot:
            kind = "task" if isinstance(part, Task) else "field"
            raise ControllerError(
                f"{kind} {part.name!r} was built for another robot object "
                f"({part.robot.name}); build it with the controller's"
            )
    for number, level in enumerate(levels, start=1):
        rows = sum(task.rows for task in level)
        if rows > robot.nv:
            each = ", ".join(f"{task.name}: {task.rows}" for task in level)
            where = f" of level {number}" if len(levels) > 1 else ""
            raise ControllerError(
                f"the tasks{where} have {rows} rows ({each}); "
                f"{robot.name} has only {robot.nv} freedoms"
            )


def checked_gain(gain: Any, robot: Robot, metric: Metric) -> Array:
    """Return K_N as a matrix for which V' = -e_NᵀW K_N e_N < 0.

    For the mass matrix W changes with q; there K_N alone is asked to be positive
    definite, and only a multiple of the identity is proved for every q.
    """
    K_N = as_matrix(as_gain(gain, "null_space_gain"), robot.nv, "null_space_gain")
    sample = MetricSample.allocate(robot.nv)
    if metric.form != VARYING:
        state = robot.state(0.0, robot.neutral(), np.zeros(robot.nv))
        metric.evaluate(state, sample)
    decay = sample.W @ K_N
    least = float(np.linalg.eigvalsh(0.5 * (decay + decay.T))[0])
    if least <= 0.0:
        raise GainError(
            "null_space_gain does not make the null-space error decay: the least "
            f"eigenvalue of W K_N is {least:.3g}; must be greater than 0"
        )
    return K_N


def check_support(robot: Robot, contacts: Sequence[Contact], base: Base | None) -> None:
    """Refuse a floating base without support, and support without a floating base.

    Raises:
        ContactError: If they do not fit.
    """
    if base not in {None, "flying", "driven"}:
        raise ContactError(f"base is {base!r}; needs 'flying', 'driven' or None")
    if not robot.unactuated:
        if contacts or base is not None:
            raise ContactError(
                f"{robot.name} has no free-flyer root: contacts and base are for "
                "robots that may fall"
            )
        return
    if not contacts and base is None:
        raise ContactError(
            f"no motor moves the free-flyer root of {robot.name}: declare contacts, or "
            "base='flying' (nothing holds it), or base='driven' (something else does)"
        )
    if contacts and base == "driven":
        raise ContactError("base='driven' needs no contacts, and there are some")
    names = [contact.name for contact in contacts]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ContactError(f"two contacts are called {twice[0]!r}; give them names")
    for contact in contacts:
        if contact.robot is not robot:
            raise ContactError(
                f"contact {contact.name!r} was built for another robot object "
                f"({contact.robot.name}); build it with the controller's"
            )


def check_schedules(schedules: Mapping[str, Any], tasks: Sequence[str]) -> None:
    """Refuse schedules of tasks that do not exist.

    Raises:
        ControllerError: Names the nearest task.
    """
    for name in schedules:
        if name not in tasks:
            raise ControllerError(
                f"there is no task {name!r} to be scheduled"
                f"{did_you_mean(name, tasks)} (there are {listing(tasks)})"
            )
