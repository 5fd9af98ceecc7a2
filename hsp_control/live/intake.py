"""A loop's view of its robot: each period the newest state, seen or reckoned."""

from collections.abc import Callable

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError
from hsp_control.constraints.limits import Limits
from hsp_control.live.dead_reckoning import DeadReckoning
from hsp_control.live.deadlines import Deadlines
from hsp_control.live.guard import Guard
from hsp_control.live.hardware import Hardware, Measurement
from hsp_control.live.settings import Tolerance
from hsp_control.robot import Robot, RobotState

_SLACK = 0.5
"""By what part of a period a state may be late before its period counts as silent."""


class Intake:
    """Reads measurements against the clock, and says what is wrong with them.

    Attributes:
        found: The measurement of this period; None if there was none that is a state,
            and new.
        trouble: Why the robot has to be stopped, if it has to.
        error: What the hardware raised, if it did.
        gone: Whether no state will ever come again.
        began: When the loop had this period's state [s], by its own clock.
        deadlines: How late all was.
    """

    def __init__(
        self,
        robot: Robot,
        limits: Limits | None,
        hardware: Hardware,
        tolerance: Tolerance,
        clock: Callable[[], float],
    ) -> None:
        """Allocate."""
        self._hardware, self._tolerance, self._clock = hardware, tolerance, clock
        self._guard = Guard(robot, limits, tolerance)
        self._reckoning = DeadReckoning(robot, hardware.period)
        self._period = hardware.period
        self._missing = 0
        self._shift = 0.0
        self.found: Measurement | None = None
        self.trouble: str | None = None
        self.error: Exception | None = None
        self.gone = False
        self.began = self._arrived = self._due = clock()
        self.deadlines = Deadlines(hardware.period)

    @property
    def state(self) -> RobotState:
        """The robot's state at the law's time, seen or reckoned."""
        return self._reckoning.state

    @property
    def blind(self) -> float:
        """For how long no state has been seen [s]."""
        return self._reckoning.blind

    def first(self, start_time: float) -> Measurement:
        """Wait for a first state, which will be at ``start_time`` [s].

        Raises:
            HardwareError: If none comes in time, or the robot is not fit to start.
        """
        end = self._clock() + self._tolerance.start
        while (left := end - self._clock()) > 0.0:
            found = self._hardware.read(left)
            if found is None:
                continue
            reason = self._guard.no_state(found) or self._guard.breach(found)
            if reason is not None:
                raise HardwareError(f"the robot is not fit to start: {reason}")
            self._shift = start_time - found.t
            self._see(found)
            return found
        raise HardwareError(
            f"no state of the robot came in {self._tolerance.start:g} s"
        )

    def begin(self) -> None:
        """Start the clock; what was not seen meanwhile says nothing of the loop."""
        self._guard.last = None
        self._arrived = self._clock()
        self._due = self._arrived + (1.0 + _SLACK) * self._period

    def take(self, acting: Array) -> None:
        """Take the period's measurement, or reckon where the robot is without.

        Args:
            acting: The effort of the motors, shape (nv,).
        """
        self.trouble = self.error = self.found = None
        raw = self._read()
        if raw is not None:
            self.trouble = self._guard.no_state(raw)
        found = self._guard.news(raw) if self.trouble is None else None
        self.began = self._clock()
        if found is None:
            self._miss(acting)
            return
        self.trouble = self._guard.breach(found)
        if (last := self._guard.last) is not None:
            self.deadlines.unseen += found.sequence - last.sequence - 1
        self._see(found)

    def answered(self) -> float:
        """Note that the period's effort is out; return how long it took [s]."""
        response = self._clock() - self.began
        if self.found is not None:
            self.deadlines.add(self.began - self._arrived, response)
            self._arrived = self.began
            self._due = self.began + (1.0 + _SLACK) * self._period
        return response

    def _read(self) -> Measurement | None:
        try:
            return self._hardware.read(max(self._due - self._clock(), 0.0))
        except (HardwareError, OSError) as error:
            self.trouble, self.error = f"no state can be read: {error}", error
            self.gone = True
            return None

    def _see(self, found: Measurement) -> None:
        self._guard.last = self.found = found
        self._missing = 0
        self._reckoning.see(found.t + self._shift, found.q, found.v)

    def _miss(self, acting: Array) -> None:
        self._reckoning.reckon(acting)
        self._missing += 1
        self.deadlines.silent += 1
        self._due = max(self._due + self._period, self._clock())
        if self.trouble is None and self._missing > self._tolerance.missing:
            self.trouble = f"no new state for {self._missing} periods"
