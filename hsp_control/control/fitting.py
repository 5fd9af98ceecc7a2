"""Whether the parts of a controller fit one another and the robot."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ContactError, ControllerError, GainError
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits
from hsp_control.declaration import Part, within
from hsp_control.declaration.language import check_kind, shortened
from hsp_control.declaration.quantities import LARGEST
from hsp_control.law import VARYING, MetricSample
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import Robot
from hsp_control.robot.state import as_given
from hsp_control.tasks import Task
from hsp_control.tasks.gains import as_matrix

Base = Literal["flying", "driven"]
"""The actuation of a free-flyer root besides contacts: none, or external."""


def check_parts(what: str, parts: object, kind: type[Part]) -> None:
    """Check that an argument is several parts of a kind."""
    if isinstance(parts, kind | Mapping | str) or not isinstance(parts, Iterable):
        needed = f"needs several, such as [{kind.__name__.lower()}]"
        if isinstance(parts, Mapping) and getattr(kind, "yaml_key", None) == "name":
            needed = (
                f"in Python it is a list, with name={next(iter(parts), '')!r} there"
            )
        raise ControllerError(f"{what} is {shortened(repr(parts))}; {needed}")
    for part in parts:
        if isinstance(part, list | tuple):
            raise ControllerError(
                f"{what} contains lists; write the level as priority=1, 2, ... of each "
                "task"
            )
        check_kind(f"{what} contains", part, kind, ControllerError)


def check_limits(limits: Limits | None) -> None:
    """Check limits that were given in Python, where None has YAML's meaning of none."""
    if limits == "none":
        raise ControllerError("limits is 'none'; in Python it is None")
    if limits is not None:
        check_kind("limits is", limits, Limits, ControllerError)


def check_tasks(tasks: Sequence[Task], robot: Robot) -> None:
    """Check that tasks have different names, and that no level is large."""
    names = [task.name for task in tasks]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ControllerError(
            f"two tasks are called {twice[0]!r}; give them distinct names"
        )
    for priority in sorted({priority_of(task, robot) for task in tasks}):
        level = [task for task in tasks if priority_of(task, robot) == priority]
        rows = sum(task.rows for task in level)
        if rows > robot.nv:
            each_of = ", ".join(f"{task.name}: {task.rows}" for task in level)
            where = "" if len(level) == len(tasks) else f" of priority {priority}"
            raise ControllerError(
                f"the tasks{where} have {rows} rows ({each_of}); "
                f"{robot.name} has only {robot.nv} degrees of freedom"
            )


def priority_of(task: Task, robot: Robot) -> int:
    """Return the priority of a placed task, 1 the highest."""
    # The default is 1; on a floating base 1 for balance tasks and 2 for all others, so
    # that a hand target out of reach does not make the robot fall.
    if task.priority is not None:
        return task.priority
    return 2 if robot.unactuated and not task.keeps_balance(robot) else 1


def checked_gain(gain: ArrayLike, robot: Robot, metric: Metric) -> Array:
    """Return K_N as a matrix, checked for V' = -e_NᵀW K_N e_N < 0.

    So W K_N + K_NᵀW must be positive definite. Where W is constant that is looked at.
    Where W changes with q it must hold for every W(q): for multiples of the identity it
    does, since then V' = -2 K_N V, and other gains are refused. A diagonal of positive
    numbers is not enough: over the mass matrix some let e_N grow at some
    configurations.
    """
    K_N = as_matrix(np.asarray(gain, dtype=float), robot.nv, "null_space_gain")
    if np.abs(K_N).max() > LARGEST:
        raise GainError(
            f"null_space_gain contains {np.abs(K_N).max():g}, which is absurdly large; "
            f"its size must be {LARGEST:g} at most"
        )
    if metric.form == VARYING:
        if not np.array_equal(K_N, K_N[0, 0] * np.eye(robot.nv)):
            raise GainError(
                "null_space_gain is no multiple of the identity, and the metric "
                f"({type(metric).__name__}) changes with the configuration: at some "
                "configurations the null-space error could grow instead of decay; "
                f"needs one number, for example {np.diag(K_N).min():g}, or a metric "
                "that does not change"
            )
        return K_N
    state = robot.state(0.0, robot.neutral(), np.zeros(robot.nv))
    state = as_given(metric, state)
    W = metric.evaluate(state, MetricSample.allocate(robot.nv)).W
    decay = W @ K_N
    smallest = float(np.linalg.eigvalsh(0.5 * (decay + decay.T))[0])
    if smallest <= 0.0:
        raise GainError(
            "null_space_gain does not make the null-space error decay: the smallest "
            f"eigenvalue of W K_N is {smallest:.3g}; must be greater than 0"
        )
    return K_N


def check_support(robot: Robot, contacts: Sequence[Contact], base: Base | None) -> None:
    """Check that contacts and ``base`` are given exactly where the robot needs them."""
    if base not in {None, "flying", "driven"}:
        raise ContactError(f"base is {base!r}; needs 'flying', 'driven' or None")
    if not robot.unactuated and base is not None:
        with within("base"):
            raise ContactError(
                f"{robot.name} has no free-flyer root: base is only for robots with a "
                "floating base"
            )
    if robot.unactuated and not contacts and base is None:
        raise ContactError(
            f"no motor moves the free-flyer root of {robot.name}: declare contacts, or "
            "base='flying' (nothing acts on it), or base='driven' (something else "
            "moves it)"
        )
    if contacts and base == "driven":
        with within("base"):
            raise ContactError(
                "base='driven' needs no contacts, but contacts are given"
            )
    names = [contact.name for contact in contacts]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ContactError(
            f"two contacts are called {twice[0]!r}; give them distinct names"
        )
