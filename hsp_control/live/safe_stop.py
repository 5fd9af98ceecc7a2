"""The safe stop: first damping, then hold, on the stance feet."""

from collections.abc import Callable, Sequence
from enum import IntEnum

import numpy as np

from hsp_control.common.arrays import Array, Flags
from hsp_control.constraints.contacts import Contact
from hsp_control.control.measurement import Measurement
from hsp_control.control.stop import STEEPEST, BoundStop
from hsp_control.live.settings import StopSettings
from hsp_control.robot import Robot, RobotState


class Phase(IntEnum):
    """Phase of a robot under a loop, from its start to its stop."""

    WAITING = 0
    RUNNING = 1
    DAMPING = 2
    HOLDING = 3


class StandingFeet:
    """The active contacts of a robot, on which it stands while it is stopped.

    A floating base without a stance foot cannot be held.
    """

    def __init__(self, robot: Robot, contacts: Sequence[Contact]) -> None:
        self.all = tuple(c for c in contacts if c.axes[2, 2] >= STEEPEST)
        self._floats = bool(robot.unactuated)
        self.contacts = self.all  # the contacts that are active now

    @property
    def hold(self) -> bool:
        """Whether the robot can be held: by its base, or by a foot that stands."""
        return not self._floats or bool(self.contacts)

    def update(self, measured: Measurement) -> None:
        """Update the active contacts: the loaded ones."""
        if self._floats:
            self.contacts = tuple(c for c in self.all if _stands(c, measured))

    def lift(self) -> None:
        """Deactivate all contacts."""
        self.contacts = ()


def _stands(contact: Contact, measured: Measurement) -> bool:
    force = measured.normal_force(contact.frame, contact.axes[:, 2])
    return contact.active(measured.t) if force is None else force > 0.0


class SafeStop:
    """Brakes a robot until it is at rest, then holds its position; see `BoundStop`.

    A robot with a floating base stands on its feet meanwhile: the share of damping and
    hold on its base is exerted through the stance feet (`StandingFeet`). Without one,
    or after a fall, it cannot be held, and its joints are damped only.

    Attributes:
        feet: The feet of the robot.
        held_for: Time spent holding [s].
    """

    def __init__(
        self,
        robot: Robot,
        settings: StopSettings,
        effort_limits: Array,
        period: float,
        feet: StandingFeet | None = None,
    ) -> None:
        """Check the gains for this period.

        Args:
            robot: The model.
            settings: Gains and durations.
            effort_limits: Upper limits of the efforts, shape (nv,); they may change.
            period: Time between two calls of `effort` [s].
            feet: The feet of a robot with a floating base; None: none.

        Raises:
            LiveError: If the period is too long for the settings.
        """
        settings.check_period(period)
        self._robot, self._settings, self._period = robot, settings, period
        self._effort_limits = effort_limits
        self.feet = StandingFeet(robot, ()) if feet is None else feet
        self._bound: BoundStop | None = None
        self._acts = np.zeros(robot.nv)
        self.begin()

    def begin(self) -> None:
        """Start a safe stop, with damping."""
        if self._bound is not None:
            self._bound.begin()
        self.held_for = 0.0

    @property
    def phase(self) -> Phase:
        """`Phase.DAMPING` or `Phase.HOLDING`."""
        holds = self._bound is not None and bool(self._bound.holding[0])
        return Phase.HOLDING if holds else Phase.DAMPING

    @property
    def damped_for(self) -> float:
        """Time spent damping [s]."""
        return 0.0 if self._bound is None else self._bound.damped_for.item()

    @property
    def held_q(self) -> Array:
        """The configuration in which the robot is held, shape (nq,); neutral before."""
        return self._robot.neutral() if self._bound is None else self._bound.held_q

    @property
    def done(self) -> bool:
        """Whether the robot has been held for `StopSettings.hold`."""
        held = self.held_for >= self._settings.hold - 0.5 * self._period
        return self.phase == Phase.HOLDING and held

    @property
    def load(self) -> Array:
        """The external effort on the joints that is compensated, shape (nv,)."""
        robot = self._robot
        return np.zeros(robot.nv) if self._bound is None else self._bound.load.load

    def restart(self) -> None:
        """Reset everything, also the load."""
        if self._bound is not None:
            self._bound.load.forget()
        self.begin()

    def observe(self, state: RobotState, acts: Array, silent: Flags) -> None:
        """Learn from a period, also of the stop while measurements are consistent.

        Args:
            state: The robot's state.
            acts: The effort that acts from now on, shape (nv,).
            silent: Joints whose readings are the same to the last bit, shape (nv,).
        """
        load = self._bound_to(state).load
        load.permit(self._effort_limits)
        self._acts[:] = acts
        load.changed(~silent)  # without the apparent load of the last change itself
        self._learn()

    def trust(self, *, measurements: bool, dead: Flags) -> None:
        """Use the newest load; or, if a measurement is wrong, that of before it.

        ``dead`` are the joints whose sensors have died, shape (nv,).
        """
        if self._bound is not None:
            self._bound.load.use(newest=measurements, dead=dead)

    def effort(self, state: RobotState) -> Array:
        """Return the effort of this period at the state, shape (nv,); once a period."""
        bound = self._bound_to(state)
        bound.limits[:] = self._effort_limits
        bound.stand_on(self.feet.contacts)
        self._make()
        if bound.holding[0]:
            self.held_for += self._period
        return bound.tau.copy()

    def _bound_to(self, state: RobotState) -> BoundStop:
        """Return the stop at a state, which continues the one at another state."""
        before = self._bound
        if before is not None and before.state is state:
            return before
        gains, period = self._settings.gains, np.array([self._period])
        self._bound = bound = BoundStop(state, self.feet.all, gains, period)
        if before is not None:
            bound.go_on(before)
        self._make: Callable[[], object] = state.plan(bound.calls()).call()
        learning = state.plan(bound.calls_before(self._acts))
        self._learn: Callable[[], object] = learning.call()
        return bound
