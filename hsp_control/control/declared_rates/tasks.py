"""User-defined rates of a task, against differences.

The error equation follows from J a + J'v = a_x only if e' is the rate of e, and J, J'
and a_x are those of e'. So three things are looked at where the package did not write
them: e' along the flow, J' along the flow, and e'' along an acceleration that solves
J a + J'v = a_x.
"""

from collections.abc import Callable
from copy import deepcopy

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.declared_rates.comparison import (
    INTERVAL,
    Declared,
    along_the_flow,
    declared_by,
    independent_of_v,
    is_own,
    velocities,
)
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState
from hsp_control.robot.state import as_given
from hsp_control.tasks import FunctionTask, Task
from hsp_control.tasks.compliant_task import impedance_of

_WRITTEN_BY = ("call", "calls", "evaluate")
_FUNCTIONS = "rate_function", "jacobian_rate_function", "jacobian_function"
_SOLVED = 1e-6
"""Tolerated residual relative to a_x - J'v [-]: more is a singular posture."""
_DAMPED = "A task is damped by Kv of its gains"


def check_task(task: Task, state: RobotState) -> None:
    """Check the rates of a placed task at a state.

    Raises:
        RateError: If e or J depends on v, a rate is not that of its value, or the error
            equation does not follow.
    """
    if isinstance(task, FunctionTask):
        _check_function(task, state)
        written = [getattr(task, name) and name for name in _FUNCTIONS]
    elif is_own(type(task)):
        return
    else:
        written = [declared_by(task, _WRITTEN_BY)] * 3
    if task.remembers:
        task = deepcopy(task)  # previews read no messages
    error_rate, jacobian_rate, jacobian = written
    if error_rate and task.order == 2:  # an error of first order depends on v
        _check_rate(task, error_rate, "error", state)
    if jacobian_rate or jacobian:
        _check_rate(task, jacobian_rate, "jacobian", state)
    by = jacobian or jacobian_rate or error_rate
    if by and impedance_of(task) is None:
        _check_equation(task, by, state)


def _check_function(task: FunctionTask, state: RobotState) -> None:
    """Check that y does not depend on v, and the J that is given along q alone."""
    by = task.jacobian_function and "jacobian_function"

    def at(state: RobotState) -> tuple[Array, Array]:
        y = task.value(state)
        return y, task.jacobian(state) @ state.v if by else y

    words = "y", _of_row(task)
    own = independent_of_v(_named(task), *words, at, state, _DAMPED)
    if own and by:
        declared = Declared(_named(task), by, "y", "J v", words[1])
        declared.compare(*along_the_flow(at, state, timed=False), state.t)


def _check_rate(task: Task, by: str | None, value: str, state: RobotState) -> None:
    """Check e' or J' along the flow; empty ``by``: only that e or J has no v."""

    def at(state: RobotState) -> tuple[Array, Array]:
        here = task.evaluate(as_given(task, state))
        found, rate = (
            (here.error, here.error_rate)
            if value == "error"
            else (here.jacobian, here.jacobian_dot)
        )
        return found.ravel(), rate.ravel()

    def of_entry(i: int) -> str:
        row, dof = divmod(i, state.robot.nv)
        return f"{_of_row(task)(row)}, {state.robot.dof_names[dof]},"

    words: tuple[str, str, Callable[[int], str]]
    words = "e", "e' = ∂e/∂q·v + ∂e/∂t", _of_row(task)
    if value == "jacobian":
        words = "J", "J' = ∂J/∂q·v + ∂J/∂t", of_entry
    own = independent_of_v(_named(task), words[0], words[2], at, state, _DAMPED)
    if own and by:
        declared = Declared(_named(task), by, *words)
        declared.compare(*along_the_flow(at, state), state.t)


def _check_equation(task: Task, by: str, state: RobotState) -> None:
    """Check that the error equation follows from J a + J'v = a_x."""
    v, _ = velocities(state)
    there, robot = RobotState(state.robot), state.robot
    # of the unbounded error: a task may bound it in other coordinates
    feedback = task.feedback_at(state)
    largest = feedback.largest * [1.0, 1.0, np.inf]
    feedback = feedback._replace(largest=largest)

    def at(k: int, a: Array) -> TaskSample:
        s = (k - 2) * INTERVAL
        moved = robot.integrate(state.q, s * v + 0.5 * s * s * a)
        there.update(state.t + k * INTERVAL, moved, v + s * a)
        return task.evaluate(as_given(task, there), None, feedback)

    middle = at(2, np.zeros(robot.nv))
    needed = middle.acceleration - middle.jacobian_dot @ v
    a = np.linalg.lstsq(middle.jacobian, needed, rcond=None)[0]
    left = np.linalg.norm(middle.jacobian @ a - needed)
    if left > _SOLVED * (1.0 + np.linalg.norm(needed)):
        return
    wanted = -task.fed_back(feedback, middle.error, middle.error_rate)
    if task.order == 1:
        values = np.array([at(k, a).error.copy() for k in range(5)])
        words = "e", "e' = -(K e + offset)"
    else:
        values = np.array([at(k, a).error_rate.copy() for k in range(5)])
        words = "e'", "e'' = -(Kv e' + Kp e + offset)"
    advice = "correct J or a_x, or override fed_back: it declares another equation"
    if (own := declared_by(task, ("fed_back",))) != type(task).__name__:
        words = words[0], f"{words[0]}' = -{own}(feedback, e, e')"
        advice = "correct J, a_x or fed_back"
    rate = f"where J a + J'v = a_x, {words[1]}"
    declared = Declared(_named(task), by, words[0], rate, _of_row(task), advice)
    declared.compare(values, wanted, state.t)


def _named(task: Task) -> str:
    return f"task {task.name!r}"


def _of_row(task: Task) -> Callable[[int], str]:
    """Return a function that names the row of an entry of a task."""
    names = [
        each.name if each.size == 1 else f"{each.name} {i}"
        for each in task.error_parts
        for i in range(each.size)
    ]
    return lambda i: f" of {names[i]}"
