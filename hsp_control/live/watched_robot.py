"""A simulated robot that looks after itself: a plant, its watchdog, its own stop."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LiveError
from hsp_control.live.effort_port import EffortPort
from hsp_control.live.safe_stop import Phase, SafeStop
from hsp_control.live.settings import EffortInterface, StopSettings
from hsp_control.robot import RobotState
from hsp_control.simulation.plants import SampledPlant

WATCHDOG = 20
"""Periods without a valid effort after which a robot stops itself, as a Panda does."""


class WatchedRobot:
    """A plant that is advanced period by period under efforts that may fail to come.

    Until the first effort its brakes hold it and its time stands still. From then on,
    each period without one holds the last; too many of them, or one that is not finite,
    and it stops by itself as `SafeStop` says, from its true state, and follows nobody
    any more: what a real robot's safety controller and brakes do.

    Attributes:
        plant: What moves.
        period: Length of a period [s].
        t: Time since the first effort [s].
        q: True configuration, shape (nq,).
        v: True velocity, shape (nv,).
        tau: The effort of its motors in the last period, shape (nv,).
        phase: Where it is between waiting and being held.
        reason: Why it stopped.
    """

    def __init__(
        self,
        plant: SampledPlant,
        q: Array,
        v: Array,
        period: float,
        *,
        interface: EffortInterface | None = None,
        watchdog: int = WATCHDOG,
        stop: StopSettings | None = None,
    ) -> None:
        """Stand at the start.

        Args:
            plant: What moves.
            q: Start configuration, shape (nq,).
            v: Start velocity, shape (nv,).
            period: Length of a period [s].
            interface: How it wants its efforts; where it compensates gravity, it does
                so for its true mass.
            watchdog: Periods without a valid effort that it puts up with.
            stop: How it stops.

        Raises:
            LiveError: If the settings contradict each other.
        """
        if watchdog < 1:
            raise LiveError(f"watchdog is {watchdog}; needs at least 1 period")
        robot = plant.robot
        self._interface = interface or EffortInterface()
        port = EffortPort(robot, self._interface, period)
        self._stop = SafeStop(robot, stop or StopSettings(), port.greatest, period)
        self._state = RobotState(robot)
        self._rest = np.zeros(robot.nv)
        self.plant, self.period, self.watchdog = plant, period, watchdog
        self.q, self.v = q.copy(), v.copy()
        self.t, self.periods = 0.0, 0
        self.phase, self.reason = Phase.WAITING, ""
        self._silence = 0
        self._command: Array = np.zeros(robot.nv)
        self.tau = self._gravity()
        plant.reset(0.0, self.q, self.v)

    @property
    def halted(self) -> bool:
        """Whether it has stopped by itself."""
        return self.phase > Phase.RUNNING

    @property
    def done(self) -> bool:
        """Whether it has stopped, and been held for as long as its settings say."""
        return self.phase == Phase.HOLDING and self._stop.done

    def measure(self) -> tuple[Array, Array]:
        """Return what its sensors show of (q, v)."""
        return self.plant.measure(self.t, self.q, self.v)

    def halt(self, reason: str) -> None:
        """Stop; the first reason counts."""
        if self.phase <= Phase.RUNNING:
            self._stop.begin()
            self.phase, self.reason = Phase.DAMPING, reason

    def advance(self, efforts: Sequence[Array]) -> None:
        """Live through a period.

        Args:
            efforts: What came in it, shape (nv,) each; the last one counts.
        """
        if self.phase <= Phase.RUNNING:
            self._listen(efforts)
        if self.phase == Phase.WAITING:
            return
        if self.phase == Phase.RUNNING:
            self.tau = self._command
            if self._interface.compensates_gravity:
                self.tau = self.tau + self._gravity()
        else:
            state = self._state.update(self.t, self.q, self.v)
            self.tau = self._stop.effort(state)
            self.phase = self._stop.phase
        end = (self.periods + 1) * self.period
        self.q, self.v = self.plant.advance(self.t, end, self.tau)
        self.periods += 1
        self.t = end

    def _gravity(self) -> Array:
        return self.plant.robot.inverse_dynamics(self.q, self._rest, self._rest)

    def _listen(self, efforts: Sequence[Array]) -> None:
        if not efforts:
            self._silence += self.phase == Phase.RUNNING
            if self._silence > self.watchdog:
                self.halt(f"the watchdog: no valid effort for {self._silence} periods")
            return
        self._silence = 0
        if self.phase == Phase.WAITING:
            self.phase = Phase.RUNNING
        if not np.isfinite(efforts[-1]).all():
            self.halt(f"an effort that is not finite: {efforts[-1].tolist()}")
            return
        self._command = np.array(efforts[-1], dtype=float)
