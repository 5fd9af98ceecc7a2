"""The safe stop of a frozen controller: that of `hsp live`, for ``hsp_stop``."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits.joint_numbers import own_maximum
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.controller import Controller
from hsp_control.control.stop import BoundStop
from hsp_control.control.stop import StopGains as StopGains
from hsp_control.engine import Call, Move, Plan
from hsp_control.engine.plans import Step
from hsp_control.frozen.image import Port

LIKE_LIVE = StopGains()
"""Those that `hsp live` has by default."""


class Stopping(NamedTuple):
    """The safe stop of a frozen controller."""

    move: Move
    """It, as one move."""
    before: Sequence[Step]
    """Its calls at the end of a step: they estimate the load."""
    outputs: list[Port]
    """Its outputs."""


def stopping(
    own: Controller,
    bound: BoundStep,
    gains: StopGains,
    period: Array,
    origin: Array,
    first: Sequence[Call],
    acts: Array,
) -> Stopping | None:
    """Return the safe stop; None: nothing carries the robot.

    A robot on feet stands on the contacts of the controller meanwhile.

    Args:
        own: The controller.
        bound: Its step.
        gains: How it brakes.
        period: Time for which an effort is held, shape (1,) [s].
        origin: The clock's reading at time 0, shape (1,) [s].
        first: The calls that bring the model up to a time.
        acts: The effort that a step delivers, shape (nv,).
    """
    robot, state = own.robot, bound.state
    if robot.unactuated and not own.contacts:
        return None
    stop = BoundStop(state, own.contacts, gains, period)
    if own.limits is None:
        stop.limits[:] = own_maximum(robot.model.effortLimit, robot)
    else:
        stop.limits[:] = own.limits.effort
    stop.limits[list(robot.unactuated)] = 0.0  # no motor is there
    stop.load.permit(stop.limits)
    values = state.bind_move(state.plan(stop.calls()).steps(), origin).values
    calls = Plan([*first, *values["calls"].calls])
    effort = Port("stop.tau", "N·m or N", "the effort that brakes, or holds", stop.tau)
    held = Port("stop.holding", "-", "whether it holds", stop.holding)
    rate = Port("stop.damping", "1/s", "damping of the stop", np.array([gains.damping]))
    besides, unit = "external effort on the joints before the stop", "N·m or N"
    load = Port("stop.load", unit, besides, stop.load.load)
    move = engine.Move(**values | {"calls": calls})
    before = state.plan(stop.calls_before(acts)).steps()
    return Stopping(move, before, [effort, held, rate, load])
