"""The safe stop of a frozen controller: what `hsp live` does, for ``hsp_stop``."""

from collections.abc import Sequence

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits.joint_numbers import own_maximum
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.controller import Controller
from hsp_control.control.stop import BoundStop
from hsp_control.control.stop import StopGains as StopGains
from hsp_control.engine import Call, Move, Plan
from hsp_control.frozen.image import Port

LIKE_LIVE = StopGains()
"""Those that `hsp live` has by default."""


def stopping(
    own: Controller,
    bound: BoundStep,
    gains: StopGains,
    period: Array,
    origin: Array,
    first: Sequence[Call],
) -> tuple[Move | None, list[Port]]:
    """Return the safe stop as one move, and its outputs; None: nothing carries it.

    A robot on feet stands on the contacts of the controller meanwhile.

    Args:
        own: The controller.
        bound: Its step.
        gains: How it brakes.
        period: How long each effort is held, shape (1,) [s].
        origin: What the clock reads at time 0, shape (1,) [s].
        first: The calls that bring the model up to a time.
    """
    robot, state = own.robot, bound.state
    if robot.unactuated and not own.contacts:
        return None, []
    stop = BoundStop(state, own.contacts, gains, period)
    if own.limits is None:
        stop.limits[:] = own_maximum(robot.model.effortLimit, robot)
    else:
        stop.limits[:] = own.limits.effort
    stop.limits[list(robot.unactuated)] = 0.0  # no motor is there
    values = state.bind_move(state.plan(stop.calls()).steps(), origin).values
    calls = Plan([*first, *values["calls"].calls])
    effort = Port("stop.tau", "N·m or N", "the effort that brakes, or holds", stop.tau)
    held = Port("stop.holding", "-", "whether it holds", stop.holding)
    rate = Port("stop.damping", "1/s", "how it brakes", np.array([gains.damping]))
    return engine.Move(**values | {"calls": calls}), [effort, held, rate]
