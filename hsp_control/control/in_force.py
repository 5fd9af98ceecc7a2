"""The part of a time line in force now, and the step that is bound for it."""

from typing import NamedTuple

import numpy as np

from hsp_control.control.actuation.limits_in_force import LimitsAt, LimitsInForce
from hsp_control.control.bound_mixture import BoundMixture
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.changes import TimeLine
from hsp_control.control.declared import DeclaredController
from hsp_control.control.gains_in_force import GainsInForce, PlannedGains
from hsp_control.control.memory import RunMemory
from hsp_control.control.mixture import Mixture
from hsp_control.control.model_in_force import ModelInForce
from hsp_control.control.setup import Setup
from hsp_control.control.tools_in_force import ToolsInForce
from hsp_control.engine import Plan
from hsp_control.engine.plans import planned
from hsp_control.robot import RobotState

MEMORY = 1.0
"""Changes that were complete this long ago are forgotten [s]; an integrator may request
earlier times than the last one."""


class InForce:
    """The part of a time line in force now, and the step that is bound for it.

    Gains, limits, model and tools are arrays that the calls of a step read, and while
    they change it begins with those that write them. The calls of steps are bound in
    `follow`, when a change is made, also for the time when all changes are over.
    """

    time_line: TimeLine
    setup: Setup  # that of the time line
    limits: LimitsInForce
    mixture: Mixture
    step: BoundStep | BoundMixture | None  # as one call; None: Python makes it
    later: "AfterChanges | None"  # once all changes are over; None: nothing changes

    def __init__(
        self, declared: DeclaredController, state: RobotState, memory: RunMemory
    ) -> None:
        self._declared, self._state, self._memory = declared, state, memory
        self.gains = GainsInForce(state.robot.nv, memory)
        self.model = ModelInForce(state.robot, [state.dynamics])
        self.tools = ToolsInForce(state)
        self.step = None
        self.later = None
        self._tried = False  # whether binding the step was tried
        self._over: tuple[object, ...] | None = None  # no longer followed

    def begin(self, time_line: TimeLine) -> None:
        """Make the objects that compute, and follow a time line."""
        state, own, setup = self._state, self._declared, time_line.setup
        base = () if own.base == "driven" else own.robot.unactuated
        self.limits = LimitsInForce(state, setup.limits, self._memory.sent)
        around = self.limits, self.gains, setup, own.threshold
        self.mixture = Mixture(state, base, *around)
        self.follow(time_line)

    def follow(self, time_line: TimeLine) -> None:
        """Follow a time line from now on; the calls of its steps are bound."""
        self._memory.follow(time_line.streams())
        self._over = None
        self._plan(time_line)
        self.model.plan(self.setup.payloads, self.setup.gravity, self.latest)
        self.tools.plan(self.setup.tools, self.latest)
        calls = *self.gains.calls, *self.limits.calls, *self.model.calls
        self._evolving = [*planned(calls).steps(), *self.tools.steps]
        self._write = Plan(self._evolving)
        self.mixture = self.mixture.following(self.setup)
        self.later, self._tried, step = None, False, None
        if self._memory.begun:
            self.bind_ahead()
            step = self._bound_step()
        self.step = step

    def go_over_to(self, time_line: TimeLine) -> None:
        """Follow another time line; if it cannot be bound, the previous one is kept."""
        before = self.time_line
        try:
            self.follow(time_line)
        except BaseException:
            self.follow(before)
            raise

    def bind_ahead(self) -> None:
        """Bind the calls of steps until all changes are over, and after that.

        Not before the first state: from it follow the motions that contacts leave free.
        """
        time_line, mixture, self._tried = self.time_line, self.mixture, False
        if time_line.open or not mixture.steady:
            mixture.prepare(self.setup.instants(self.latest))
        if not time_line.open:
            return
        end = max(each.end for each in time_line.open)
        over = time_line.settled_at(end)
        following = mixture.following(over.setup)
        following.resolved = []  # a stack from before the change, freed now
        following.prepare([end])
        step = following.bound_step(self._memory.origin, [])
        gains = self.gains.planned(over.setup)
        limits = self.limits.planned(over.setup.limits, end)
        at = end + MEMORY
        self.later = AfterChanges(at, over, following, step, gains, limits)

    def advance(self, t: float) -> None:
        """Write the values in force at a time [s]."""
        if self.later is not None:
            self.write(t)
            self.passed(t)
        self._memory.now = max(self._memory.now, t)

    def passed(self, t: float) -> None:
        """Drop the changes if they are over at the time of a step [s]."""
        memory, later = self._memory, self.later
        memory.now = max(memory.now, t)
        if later is None or memory.now <= later.at:
            return
        # The values in force are written. The next change binds calls of model and
        # tools anew and frees these: freeing needs longer than a step.
        over = self.time_line, self.setup, self.mixture, self.step, later
        self.time_line, self.setup = later.time_line, later.time_line.setup
        gains = self.gains.go_over_to(later.gains)
        self._over = *over, gains, self.limits.go_over_to(later.limits)
        resolved = self.mixture.resolved  # by the last step
        self.mixture, self.step, self.later = later.mixture, later.step, None
        self.mixture.resolved = resolved

    def write(self, t: float) -> None:
        """Write the gains, the limits, the model and the tools of a time [s]."""
        self._write(t)
        self.tools.forget()

    def bind_step(self) -> None:
        """Bind the step as one call, after the first one, if there is none yet."""
        if self.step is None and not self._tried:
            self.step = self._bound_step()

    def _bound_step(self) -> BoundStep | BoundMixture | None:
        self._tried = True
        steps = self._evolving if self.later else []
        return self.mixture.bound_step(self._memory.origin, steps)

    @property
    def kept(self) -> TimeLine:
        """The time line without the changes that are over, for one more change.

        An integrator that evaluates earlier times than the last one does so within one
        of its steps, and changes are made between them.
        """
        return self.time_line.settled_at(self.latest)

    @property
    def latest(self) -> float:
        """The latest time of a step [s]; -inf before the first one."""
        memory = self._memory
        return max(memory.now, self._state.t) if memory.begun else -np.inf

    def _plan(self, time_line: TimeLine) -> None:
        setup, t = time_line.setup, self.latest
        self.time_line, self.setup = time_line, setup
        self.gains.plan(setup, t)
        self.limits.plan(setup.limits, t)


class AfterChanges(NamedTuple):
    """The calls of a controller after all changes."""

    at: float  # from when on [s]
    time_line: TimeLine
    mixture: Mixture
    step: BoundStep | BoundMixture | None
    gains: PlannedGains
    limits: LimitsAt
