"""The parts of a controller that cannot run without Python, with their keys."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.errors import FreezeError
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.compensation import Compensation
from hsp_control.control.controller import Controller
from hsp_control.declaration import within
from hsp_control.declaration.nested import parts_within
from hsp_control.engine import PythonCall
from hsp_control.engine.inspection import calls
from hsp_control.engine.plans import PartCall, StepPlan, planned, supplied
from hsp_control.frozen.image import refusal
from hsp_control.frozen.task_sets import TaskSets
from hsp_control.law import FieldSample, MetricSample, TaskSample
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.fields.weight import Ramp, SetWeight, Weight
from hsp_control.robot import RobotState
from hsp_control.trajectories.streams.followed import FollowedStream

Path = tuple[str | int, ...]


def check_steady(own: Controller) -> None:
    """Check that a controller has one stack at all times.

    Raises:
        FreezeError: If something changes over time, with its key.
    """
    setup = own.setup
    if own.changes:
        with within("changes"):
            raise FreezeError(
                "a frozen controller follows no time line: remove the changes; gains, "
                "K_N, weights and presences are inputs, which hsp_ramp changes"
            )
    for each in setup.tasks:
        if not each.always:
            with within("tasks", each.task.name, "schedule"):
                raise FreezeError(
                    "a frozen controller follows no schedule: remove it, and freeze "
                    "with the presence of the task as an input (--presence)"
                )
    for one in setup.contacts:
        if not one.always:
            with within("contacts", one.contact.name, "schedule"):
                raise FreezeError("a frozen controller stands on the same feet")


def check_stack(own: Controller, bound: BoundStep, compensators: bool) -> None:
    """Check that the contacts of a bound step constrain every motion of the base.

    Args:
        own: The controller.
        bound: Its step.
        compensators: Whether there are any.

    Raises:
        FreezeError: If they do not, or compensators would need to know the forces.
    """
    active = bound.active
    if active.first_task_row > sum(contact.rows for contact in active.contacts):
        with within("contacts" if active.contacts else "base"):
            raise FreezeError(
                "the motion of a base that contacts leave free is computed in "
                "Python; needs contacts that hold all of the base"
            )
    if compensators and not bound.direct and active.contacts:
        with within("compensation"):
            raise FreezeError("compensators are frozen without contacts only")


def check_sets(compensation: Compensation, sets: TaskSets | None) -> None:
    """Check that no error is integrated while tasks come and go.

    Raises:
        FreezeError: If one is.
    """
    if sets is not None and compensation.integral_action is not None:
        with within("compensation", "integral_action"):
            raise FreezeError(
                "it integrates the errors of tasks that are always present; here "
                f"{', '.join(sets.names)} come and go"
            )


def check_streams(own: Controller) -> None:
    """Check that streams are of the kind that a program can feed.

    Raises:
        FreezeError: If one is not, with its key.
    """
    for task in own.tasks:
        for each in parts_within(task, FollowedStream):
            stream = each.run.stream
            reasons = {
                "source": stream.source is None or "the program sets targets instead",
                "messages": stream.messages is None or "a recording is read in Python",
            }
            for name, reason in reasons.items():
                if reason is not True:
                    with within("tasks", task.name, "trajectory", name):
                        raise FreezeError(
                            f"{getattr(stream, name)!r:.60} cannot be frozen: {reason}"
                        )


def check_parts(own: Controller) -> None:
    """Check that all parts are the engine's.

    Raises:
        FreezeError: If one of them is Python, with its key.
    """
    state = RobotState(own.robot)
    state.update(0.0, own.setup.start.state.q, np.zeros(own.robot.nv))
    for path, plan in _plans_of(own, state):
        for call in (each for step in plan.steps() for each in calls(step)):
            if isinstance(call, PythonCall):
                with within(*path):
                    raise FreezeError(refusal(call))
    limits = own.limits
    for k, each in enumerate(() if limits is None else limits.barriers):
        if not each.room(state):
            with within("limits", "barriers", k):
                raise FreezeError(f"{each!r:.200} computes its rows in Python")


def _plans_of(own: Controller, state: RobotState) -> Iterator[tuple[Path, StepPlan]]:
    """Yield the keys of the law's parts, and their calls, for checks only."""
    nv, form = own.robot.nv, own.metric.form
    for task in own.tasks:
        if task.followed is not None:
            yield ("tasks", task.name, "trajectory"), supplied(task.followed)[1]
        rows = TaskSample.allocate(task.rows, nv)
        yield ("tasks", task.name), planned(task.calls(state, task.feedback(), rows))
    for each in own.setup.contacts:
        force = each.contact.force
        if force is not None:
            key = "contacts", each.contact.name, "force"
            yield key, supplied(force.followed)[1]
    metric, sample = MetricSample.allocate(nv), FieldSample.allocate(nv)
    yield ("null_space", "metric"), planned(own.metric.calls(state, metric))
    for k, term in enumerate(terms_of(own.field)):
        path = "null_space", "fields", k
        yield path, planned(term.calls(state, metric, form, sample))
        known = type(term.weight) in (Ramp, SetWeight)
        if isinstance(term.weight, Weight) and not (known or term.weight.constant):
            weight = PartCall(term.weight.sample, state=state)
            yield (*path, "weight"), planned([weight])
