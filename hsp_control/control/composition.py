"""Checks that the parts of a controller fit together."""

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
"""What else than contacts acts on a free-flyer root: nothing, or an outside device."""


def levels_of(tasks: Sequence[Task | Sequence[Task]]) -> tuple[tuple[Task, ...], ...]:
    """Return the tasks of each level; a plain list of tasks is one level.

    Raises:
        ControllerError: If tasks and lists of tasks are mixed.
    """
    single = [entry for entry in tasks if isinstance(entry, Task)]
    nested = [tuple(entry) for entry in tasks if not isinstance(entry, Task)]
    if single and nested:
        raise ControllerError(
            "tasks mixes tasks and lists of tasks; needs a list of tasks (one level) "
            "or a list of lists (one per level)"
        )
    return tuple(nested) if nested else (tuple(single),)


def check_parts(
    robot: Robot, levels: Sequence[Sequence[Task]], field: NullSpaceField
) -> None:
    """Check that tasks and field belong to the robot, and that no level is too large.

    Raises:
        ControllerError: Names the task, the field or the level.
    """
    tasks = [task for level in levels for task in level]
    if not tasks or not all(levels):
        raise ControllerError("a controller needs at least one task, at every level")
    names = [task.name for task in tasks]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ControllerError(
            f"two tasks are called {twice[0]!r}; give them distinct names"
        )
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
                f"{robot.name} has only {robot.nv} degrees of freedom"
            )


def checked_gain(gain: Any, robot: Robot, metric: Metric) -> Array:
    """Return K_N as a matrix, checked for V' = -e_NᵀW K_N e_N < 0.

    If W is the mass matrix it changes with q: then K_N alone must be positive definite,
    and decay at every q is proved only for multiples of the identity.

    Args:
        gain: K_N: a scalar, shape (nv,) or (nv, nv) [1/s].
        robot: The robot.
        metric: The metric W.

    Raises:
        GainError: If K_N has another shape, or the null-space error would not decay.
    """
    K_N = as_matrix(as_gain(gain, "null_space_gain"), robot.nv, "null_space_gain")
    sample = MetricSample.allocate(robot.nv)
    if metric.form != VARYING:
        state = robot.state(0.0, robot.neutral(), np.zeros(robot.nv))
        metric.evaluate(state, sample)
    decay = sample.W @ K_N
    smallest = float(np.linalg.eigvalsh(0.5 * (decay + decay.T))[0])
    if smallest <= 0.0:
        raise GainError(
            "null_space_gain does not make the null-space error decay: the smallest "
            f"eigenvalue of W K_N is {smallest:.3g}; must be greater than 0"
        )
    return K_N


def check_support(robot: Robot, contacts: Sequence[Contact], base: Base | None) -> None:
    """Check that contacts and ``base`` are given exactly where the robot needs them.

    Raises:
        ContactError: If a floating base has neither, a fixed base has one of them, or a
            contact has another robot or a duplicate name.
    """
    if base not in {None, "flying", "driven"}:
        raise ContactError(f"base is {base!r}; needs 'flying', 'driven' or None")
    if not robot.unactuated:
        if contacts or base is not None:
            raise ContactError(
                f"{robot.name} has no free-flyer root: contacts and base are only for "
                "robots with a floating base"
            )
        return
    if not contacts and base is None:
        raise ContactError(
            f"no motor moves the free-flyer root of {robot.name}: declare contacts, or "
            "base='flying' (nothing acts on it), or base='driven' (something else "
            "moves it)"
        )
    if contacts and base == "driven":
        raise ContactError("base='driven' needs no contacts, but contacts are given")
    names = [contact.name for contact in contacts]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ContactError(
            f"two contacts are called {twice[0]!r}; give them distinct names"
        )
    for contact in contacts:
        if contact.robot is not robot:
            raise ContactError(
                f"contact {contact.name!r} was built for another robot object "
                f"({contact.robot.name}); build it with the controller's"
            )


def check_schedules(schedules: Mapping[str, Any], tasks: Sequence[str]) -> None:
    """Check that every schedule belongs to an existing task.

    Raises:
        ControllerError: Names the unknown task, and the most similar one.
    """
    for name in schedules:
        if name not in tasks:
            raise ControllerError(
                f"there is no task {name!r} to schedule"
                f"{did_you_mean(name, tasks)} (there are {listing(tasks)})"
            )
