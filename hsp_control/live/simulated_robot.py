"""A simulated robot behind the interface of a real one; it checks its commands."""

from collections.abc import Callable, Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError, LiveError
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import RobotLimits, own_limits
from hsp_control.live.effort_limiter import EffortLimiter
from hsp_control.live.hardware import Measurement
from hsp_control.live.safe_stop import Phase, SafeStop, StandingFeet
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.integrators import Integrator, Rk4
from hsp_control.simulation.plants import (
    ContinuousPlant,
    IntegratedPlant,
    Plant,
    SampledPlant,
)

_ROUNDING = 1e-6
"""Tolerance of efforts and their rates, relative to the limit."""
_LARGEST_EFFORT = 1e6
"""Largest effort of any motor [N·m or N], used without a limit."""


class EffortCheck:
    """The checks of a robot's own safety controller, with its own model."""

    def __init__(
        self, robot: Robot, settings: LiveSettings, period: float, effort: Array
    ) -> None:
        self._names = robot.dof_names
        # The controller's limits may be lower, and may grow at run time.
        upper = np.maximum(effort, settings.effort_limits(robot))
        self._upper = np.minimum(upper * (1.0 + _ROUNDING), _LARGEST_EFFORT)
        self._step = settings.rate_limits(robot) * period
        self._rate = settings.rate_limits(robot)
        self._compensates = settings.compensates_gravity
        speed = own_limits(robot).velocity
        self._speed = speed * (1.0 + settings.velocity_margin)

    def fault(self, effort: Array, before: Array | None, gravity: Array) -> str | None:
        """Return why an effort is refused; ``before`` is None while the brakes hold."""
        if np.shape(effort) != gravity.shape:
            return f"an effort has shape {np.shape(effort)}; needs {gravity.shape}"
        if not np.isfinite(effort).all():
            return f"an effort is not finite: {effort.tolist()}"
        # The sender may have compensated the gravity of another load.
        upper = self._upper + (np.abs(gravity) if self._compensates else 0.0)
        i = int((np.abs(effort) - upper).argmax())
        if abs(effort[i]) > upper[i]:
            return (
                f"{self._names[i]} was sent {effort[i]:.6g}; its effort is limited to "
                f"{upper[i]:.6g}"
            )
        if before is None:
            return None
        step = np.abs(effort - before)
        allowed = self._step * (1.0 + _ROUNDING) + _ROUNDING
        i = int((step - allowed).argmax())
        if step[i] > allowed[i]:
            return (
                f"the effort of {self._names[i]} jumped by {step[i]:.6g} in a period; "
                f"{self._step[i]:.6g} are allowed, a rate of {self._rate[i]:.6g}"
            )
        return None

    def too_fast(self, v: Array) -> str | None:
        """Return the joint that exceeds its speed limit, or None."""
        i = int((np.abs(v) - self._speed).argmax())
        if abs(v[i]) <= self._speed[i]:
            return None
        return (
            f"{self._names[i]} moves at {v[i]:.6g}; its speed is limited to "
            f"{self._speed[i]:.6g}"
        )


_LARGEST_SPEED = 1e4
"""Maximum joint speed of any robot [rad/s or m/s]."""


class SimulatedRobot:
    """A plant that is advanced period by period, and checks the efforts it receives.

    Until the first effort its brakes hold it and its time does not advance. Afterwards,
    in a period without an effort it holds the last one. It stops by itself with a
    `SafeStop` from its true state, within the same limits, and ignores all further
    efforts, as a real robot's safety controller and brakes do: after too many periods
    without an effort; after an effort that is not finite, beyond its limits, or faster
    than its effort rate; if a joint is too fast. If its motion cannot be computed any
    more, its brakes hold it where it was.

    Attributes:
        plant: The plant.
        period: Length of a period [s].
        t: Time since the first effort [s].
        q: True configuration, shape (nq,).
        v: True velocity, shape (nv,).
        tau: The effort of its motors in the last period, shape (nv,).
        periods: Number of periods since the first effort.
        watchdog: Number of periods without a valid effort that are tolerated.
        phase: Waiting, running, damping or holding.
        reason: Why it stopped; empty before.
    """

    def __init__(
        self,
        plant: SampledPlant,
        q: Array,
        v: Array,
        period: float,
        *,
        settings: LiveSettings | None = None,
        limits: RobotLimits | None = None,
        contacts: Sequence[Contact] = (),
        follow: Callable[[float], object] | None = None,
    ) -> None:
        """Set the robot to its start, at rest or moving.

        Args:
            plant: The plant.
            q: Start configuration, shape (nq,).
            v: Start velocity, shape (nv,).
            period: Length of a period [s].
            settings: Its watchdog, its own safe stop, its limits, and whether it
                compensates gravity, with its true mass; None: the defaults.
            limits: Limits on its efforts, if the settings have none; None: the URDF's.
                It accepts efforts within either of them.
            contacts: Its contacts, if its base is floating, for its own stop.
            follow: Sets the plant's model to that of a time [s], if it changes.

        Raises:
            LiveError: If the settings do not fit the robot or the period.
        """
        robot, settings = plant.robot, settings or LiveSettings()
        self._limiter = EffortLimiter(robot, settings, period, limits)
        upper = self._limiter.effort_limits
        self._feet = StandingFeet(robot, contacts)
        self._stop = SafeStop(robot, settings.stop, upper, period, self._feet)
        self._check = EffortCheck(robot, settings, period, upper)
        self._state = RobotState(robot, plant.dynamics)
        self._follow = follow
        self.plant, self.period, self.watchdog = plant, period, settings.watchdog
        self.q, self.v = q.copy(), v.copy()
        self.t, self.periods = 0.0, 0
        self.phase, self.reason = Phase.WAITING, ""
        self._missing = 0
        self._limiter.reset(self.q)
        self.tau = self._limiter.applied
        plant.reset(0.0, self.q, self.v)

    @property
    def halted(self) -> bool:
        """Whether it has stopped by itself."""
        return self.phase > Phase.RUNNING

    @property
    def done(self) -> bool:
        """Whether it has stopped, and was held for `StopSettings.hold`."""
        return self.phase == Phase.HOLDING and self._stop.done

    @property
    def in_force(self) -> Array | None:
        """The effort that it holds, in the form in which it receives efforts.

        Shape (nv,); None while its brakes hold it before the start.
        """
        return None if self.phase == Phase.WAITING else self._limiter.sent.copy()

    def measure(self) -> tuple[Array, Array]:
        """Return the measured q, shape (nq,), and v, shape (nv,)."""
        return self.plant.measure(self.t, self.q, self.v)

    def measured(self) -> Measurement:
        """Return its measurement, once a period, with the number of the period.

        Before the first effort no contact is loaded: its brakes hold it.
        """
        q, v = self.measure()
        wrenches = self.plant.contact_wrenches(self.t, self.q, self.v, self.tau)
        if self.phase == Phase.WAITING:
            wrenches = {frame: np.zeros(6) for frame in wrenches}
        return Measurement(
            self.periods,
            self.t,
            q,
            v,
            halted=self.halted,
            applied=self.in_force,
            wrenches=wrenches,
            inertial=self.plant.inertial(),
        )

    def halt(self, reason: str) -> None:
        """Start the safe stop; the first reason is kept."""
        if self.phase <= Phase.RUNNING:
            self._stop.begin()
            self.phase, self.reason = Phase.DAMPING, reason

    def advance(self, efforts: Sequence[Array]) -> None:
        """Simulate a period.

        Args:
            efforts: Efforts that arrived in it, shapes (nv,); the last one is used.
        """
        if self.phase <= Phase.RUNNING:
            self._receive(efforts)
        if self.phase == Phase.WAITING:
            return
        if self._follow is not None:
            self._follow(self.t)
        if self.phase == Phase.RUNNING:
            self._limiter.hold(self.q)
            fault = self._check.too_fast(self.v)
            if fault is not None:
                self.halt(fault)
        if self.phase > Phase.RUNNING:
            state = self._state.update(self.t, self.q, self.v)
            if self.plant.robot.unactuated:
                self._feet.update(self._pressed())
            effort = self._stop.effort(state)
            self._limiter.apply(effort, self.q, state.mass_matrix)
            self.phase = self._stop.phase
        self.tau = self._limiter.applied
        end = (self.periods + 1) * self.period
        self._move(end)
        self.periods += 1
        self.t = end

    def _pressed(self) -> Measurement:
        """Return the true contact wrenches."""
        q, v = self.q, self.v
        wrenches = self.plant.contact_wrenches(self.t, q, v, self.tau)
        return Measurement(self.periods, self.t, q, v, wrenches=wrenches)

    def _move(self, end: float) -> None:
        """Advance the plant; without a valid result, the brakes hold the last state."""
        try:
            q, v = self.plant.advance(self.t, end, self.tau)
        except (HspControlError, ArithmeticError, ValueError) as error:
            self._brake(f"its motion cannot be computed: {error}", end)
            return
        if np.isfinite(q).all() and np.abs(v).max() < _LARGEST_SPEED:  # NaN is not
            self.q, self.v = q, v
        else:
            self._brake("its motion cannot be computed: it is too fast", end)

    def _brake(self, reason: str, t: float) -> None:
        self.halt(reason)
        self.v = np.zeros_like(self.v)
        self.plant.reset(t, self.q, self.v)

    def _receive(self, efforts: Sequence[Array]) -> None:
        if not efforts:
            self._missing += self.phase == Phase.RUNNING
            if self._missing > self.watchdog:
                self.halt(f"the watchdog: no valid effort for {self._missing} periods")
            return
        self._missing = 0
        effort, before = efforts[-1], self.in_force
        if self.phase == Phase.WAITING:
            self.phase = Phase.RUNNING
        fault = self._check.fault(effort, before, self._limiter.gravity)
        if fault is not None:
            self.halt(fault)
            return
        self._limiter.replace_sent(np.array(effort, dtype=float))


def sampled(plant: Plant, integrator: Integrator, period: float) -> SampledPlant:
    """Return a plant as one that advances period by period; an adaptive one by Rk4."""
    if isinstance(plant, ContinuousPlant):
        adaptive = integrator.longest_step is None
        return IntegratedPlant(plant, Rk4(period) if adaptive else integrator)
    if not isinstance(plant, SampledPlant):
        raise LiveError(
            f"{type(plant).__name__} is neither a continuous nor a sampled plant"
        )
    return plant


class InProcessRobot:
    """A `SimulatedRobot` as `Hardware`: a `read` simulates the next period.

    Before the first effort, reads return the robot waiting at its start. A run is not
    in real time and has no deadline misses; it equals `simulate` with the same plant
    and period.

    Attributes:
        robot: The robot.
        period: Length of a period [s].
        closed: Whether `close` was called.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        """Connect to the robot."""
        self.robot = robot
        self.period = robot.period
        self._sequence = 0
        self._efforts: list[Array] = []
        self.closed = False

    def read(self, timeout: float) -> Measurement:
        """Simulate a period, and return the state at its end, at once."""
        self.robot.advance(self._efforts)
        self._efforts = []
        self._sequence += 1
        return self.robot.measured()._replace(sequence=self._sequence)

    def write(self, effort: Array) -> None:
        """Set the effort of the next period, shape (nv,)."""
        self._efforts.append(np.array(effort))

    def close(self) -> None:
        """Stop the robot, and simulate it until it has stopped."""
        if not self.closed:
            self.closed = True
            self.robot.halt("the loop has ended")
            while not self.robot.done:
                self.robot.advance([])
