"""A stage of the chain of compensators, and the data shared by the stages of a run."""

from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import NO_WRENCHES, LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.engine.plans import PartCalls
from hsp_control.robot import RobotState


class Run:
    """Data shared by the stages of one run, which read and write them in order."""

    # time and state for which the law is to be evaluated, at first as they are measured
    t: float
    q: Array
    v: Array
    # acceleration to deliver, at first the law's, and effort besides M a + N, (nv,)
    a: Array
    effort: Array
    output: ControlOutput  # the controller's, of the last effort

    def __init__(
        self, controller: Controller, measured: RobotState, ahead: int
    ) -> None:
        """Begin; ``ahead`` is the number of delayed efforts besides the last one."""
        self.controller = controller
        self.measured = measured  # the last measurement, where an observer needs it
        self.wrenches: Mapping[str, Array] = NO_WRENCHES  # see `Measurement`
        # time for which the next effort is held, and the last one: 0 at first [s]
        self.period = self.last_period = 0.0
        self.starting = False  # whether the law is not yet fully active
        self.none = np.zeros(controller.robot.nv)
        # unexplained effort, and that against friction, (nv,)
        self.disturbance: Array = self.none
        self.friction: Array = self.none
        self.friction_sent: Array = self.none  # of the last effort
        # the efforts on the model, less friction: one per period from the last
        # measurement to the period that begins now
        self.under_way: deque[Array] = deque(maxlen=1 + ahead)


class Alone(NamedTuple):
    """Data shared by the stages of a run in a step without Python, as arrays."""

    state: RobotState  # at which the law is evaluated
    v: Array  # the velocity, at first as it was measured
    a: Array  # acceleration to deliver, at first the law's, shape (nv,)
    effort: Array  # effort besides M a + N, at first 0, shape (nv,)
    period: Array  # time for which an effort is held, shape (1,) [s]
    acted: Array  # the effort on the model since the last measurement, (nv,)
    disturbance: Array  # acceleration from other causes, (nv,)
    starting: Indices  # whether the law is not yet fully active, shape (1,)
    damped: Indices  # the first level with a bounded inverse, or 0, shape (1,)
    status: Indices  # the `Status` of the delivered effort, shape (1,)


class AloneCalls(NamedTuple):
    """The calls of a stage in a step without Python."""

    measure: PartCalls = ()  # change the velocity, before the state moves
    observe: PartCalls = ()  # at the state, before the law
    act: PartCalls = ()  # change the acceleration or the effort
    finish: PartCalls = ()  # after the effort is delivered


class Stage:
    """A compensator in one run; by default a method changes nothing.

    Its memory is its attributes. ``_bound`` are the engine's calls on them, made at
    their first use; a copy makes its own.
    """

    _bound: Any = None

    def __getstate__(self) -> dict[str, Any]:
        return {name: own for name, own in vars(self).items() if name != "_bound"}

    def measure(self, run: Run) -> None:
        """Change the time and the state for which the law is evaluated."""

    def act(self, run: Run, state: RobotState, active: ActiveStack) -> None:
        """Change the acceleration or the effort; while tasks fade, for every set."""

    def finish(self, run: Run) -> None:
        """Advance by the period for which the effort of `Run.output` is held."""

    def alone(self, shared: Alone) -> AloneCalls | None:
        """Return the calls equivalent to all of the above; None if they need Python."""
        return None

    def log_channels(self, run: Run) -> Mapping[str, LogChannel]:
        """Return the logged values, by name."""
        return {}
