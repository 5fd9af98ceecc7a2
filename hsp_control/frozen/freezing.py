"""From a controller to a file that a program without Python runs."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FreezeError
from hsp_control.common.keywords import suggesting
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation.actuation import Actuation
from hsp_control.control.actuation.delivered import DeliveredAlone
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.compensation import Compensation
from hsp_control.control.controller import Controller
from hsp_control.control.stop import LARGEST, StopGains
from hsp_control.declaration import within
from hsp_control.engine import Move, Plan
from hsp_control.engine.plans import OnlyIf, PartCalls, Step
from hsp_control.frozen.braking import LIKE_LIVE, stopping
from hsp_control.frozen.compensated_step import CompensatedStep
from hsp_control.frozen.image import Image, Port
from hsp_control.frozen.inputs import (
    inputs_of,
    model_inputs,
    presences_of,
    streams_of,
    targets_of,
)
from hsp_control.frozen.refusals import (
    check_parts,
    check_sets,
    check_stack,
    check_steady,
    check_streams,
)
from hsp_control.frozen.task_sets import Reported, TaskSets, reported


@suggesting
def freeze(
    controller: Controller,
    path: str | os.PathLike[str],
    *,
    compensation: Compensation | None = None,
    period: float = 0.001,
    start: ArrayLike | None = None,
    payloads: Sequence[str] | None = None,
    presences: Sequence[str] = (),
    stop: StopGains = LIKE_LIVE,
) -> Path:
    """Write a controller for a program without Python, which ``hsp_step.h`` runs.

    Its step is `Controller.compute` followed by `Controller.applied`, or with
    compensators `CompensatedController.effort`, to the last bit. The controller itself
    is not changed, and its run is not continued: the file begins anew.

    Args:
        controller: The controller.
        path: The file to write, such as ``panda.hsp``.
        compensation: Compensators of model errors; None: there are none.
        period: Time for which an effort is held [s].
        start: The configuration to which relative values refer, shape (nq,); by
            default the controller's start, or else where its run began.
        payloads: Frames that may carry a payload, which becomes an input; None:
            those of the tasks.
        presences: Tasks that fade by inputs: the file has a step of every set of
            them, 2^k for k tasks.
        stop: How ``hsp_stop`` brakes the robot, and then holds it.

    Returns:
        The file.

    Raises:
        FreezeError: If a part of it cannot run without Python; the message has its key.
            Or if the stop is too fast for the period.
    """
    if not 0.0 < period < np.inf:
        raise FreezeError(f"period is {period}; needs a positive number of seconds")
    for name, most in LARGEST.items():
        if (value := getattr(stop, name)) * period > most:
            raise FreezeError(
                f"stop.{name} is {value:g}; at a period of {period:g} s it may be "
                f"{most / period:g} at most"
            )
    own = controller.without_python(period)
    image = _image(own, compensation, period, start, payloads, presences, stop)
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(image.content())
    return file


def _image(
    own: Controller,
    compensation: Compensation | None,
    period: float,
    start: ArrayLike | None,
    payloads: Sequence[str] | None,
    presences: Sequence[str],
    stop: StopGains,
) -> Image:
    """Return a step as one move, and its named inputs and outputs.

    Args:
        own: A controller at the beginning of its run; it is of no use afterwards.
        compensation: As of `freeze`.
        period: As of `freeze`.
        start: As of `freeze`.
        payloads: As of `freeze`.
        presences: As of `freeze`.
        stop: As of `freeze`.
    """
    check_steady(own)
    check_streams(own)
    check_parts(own)
    robot = own.robot
    if compensation is not None:
        with within("compensation"):
            compensation.check(robot, own.tasks, own.contacts)
    bound = own.step_alone(None if start is None else robot.check_configuration(start))
    assert bound is not None  # it is steady
    streams = streams_of(own)
    for stream in streams.values():
        stream.restart()  # after the step that has bound all
    held, delivered = np.array([period]), DeliveredAlone.allocate(robot.nv)
    sending = bound.limits.applying_all(delivered.tau, delivered.a, held)
    sets = TaskSets(own, bound, presences) if presences else None
    reports = reported(own, bound) if sets is None else sets.reported
    chain = None
    if compensation is not None:
        given = delivered, held, sending, reports.damped_level
        chain = CompensatedStep(own, bound, compensation, *given)
        check_sets(compensation, sets)
    check_stack(own, bound, chain is not None and bool(chain.stages))
    if chain is None or not chain.stages:
        move = _bare(bound, delivered, sending, sets)
    else:
        move = chain.move(sets)
    inputs = [*inputs_of(own, bound, held, reports)]
    inputs += model_inputs(own, bound, payloads)
    if sets is not None:
        inputs += presences_of(sets)
    first = [call for each in inputs for call in each.calls]
    values = move.values
    origin = np.zeros(1)  # the first step's time is written there
    after = [call for each in inputs for call in each.after]
    following = engine.OnlyIf(calls=Plan(after), condition=delivered.delivered)
    stopped = stopping(own, bound, stop, held, origin, first, delivered.tau)
    last = [*([following] if after else []), *(stopped.before if stopped else [])]
    calls = Plan([*first, *values["calls"].calls, *last])
    move = engine.Move(**values | {"calls": calls, "origin": origin})
    ports: list[Port] = [
        *_ports(own, reports, delivered, held),
        *(each.port for each in inputs),
    ]
    ports += targets_of(own, streams)
    read = Port("origin", "s", "time of the clock in the first step", origin)
    if stopped is None:
        return Image(move, [*ports, read], None)
    return Image(move, [*ports, *stopped.outputs, read], stopped.move)


def _bare(
    bound: BoundStep,
    delivered: DeliveredAlone,
    sending: PartCalls,
    sets: TaskSets | None,
) -> Move:
    """Return a step that also selects the delivered effort, and records it."""
    state, recorded = bound.state, OnlyIf(sending, delivered.delivered)
    if sets is None:
        after = bound.actuation.calls_alone(delivered)
        values, following = bound.move.values, state.plan([*after, recorded]).steps()
    else:
        values = state.bind_move([], bound.move.values["origin"]).values

        def delivering(
            _: ActiveStack, actuation: Actuation, part: DeliveredAlone
        ) -> list[Step]:
            alone = state.plan(actuation.calls_alone(part)).steps()
            return [*actuation.calls, *alone]

        record = state.plan([recorded]).steps()
        following = [*sets.calls(delivered, delivering), *record]
    calls = [*values["calls"].calls, *following]
    return engine.Move(**values | {"calls": Plan(calls)})


def _ports(
    own: Controller, reports: Reported, delivered: DeliveredAlone, period: Array
) -> Iterator[Port]:
    """Yield the inputs, and the outputs of a step."""
    effort, rate = "N·m or N", "rad/s² or m/s²"
    yield Port("tau", effort, "the last delivered effort", delivered.tau)
    yield Port(
        "acceleration",
        rate,
        "the acceleration that it causes by the model",
        delivered.a,
    )
    yield Port("status", "-", "outcome of the step", delivered.status)
    yield Port("delivered", "-", "whether there is an effort", delivered.delivered)
    yield Port("period", "s", "how long an effort is held", period)
    damped = reports.damped_level
    yield Port("damped_level", "-", "first level with a bounded inverse, or 0", damped)
    for task in own.tasks:
        e, units = reports.errors[task.name], task.error_parts
        unit = " and ".join(dict.fromkeys(each.unit for each in units))
        rates = " and ".join(dict.fromkeys(each.rate_unit for each in units))
        yield Port(f"{task.name}.error", unit, "e, reference - robot", e.error)
        yield Port(f"{task.name}.error_rate", rates, "e'", e.error_rate)
