"""Reads the robot's state each period, and goes on without one for some periods."""

from collections.abc import Callable

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError
from hsp_control.constraints.limits import RobotLimits
from hsp_control.live.hardware import Hardware, Measurement, described
from hsp_control.live.measurement_checks import (
    DeadReckoning,
    FrozenState,
    MeasurementMonitor,
    valid_measurement,
)
from hsp_control.live.report import Deadlines
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot, RobotState


class RobotClock:
    """Converts the robot's time to the controller's, and judges its steps.

    Between two measurements the robot's clock may advance by the periods that their
    sequence numbers tell, or by the tolerated number of missing states. It may stand
    before the robot starts, and for the tolerated number of states later.

    After a jump the controller's time goes on by one period: the safe stop that follows
    needs no other.
    """

    def __init__(
        self, start_time: float, period: float, tolerated: int, start_periods: float
    ) -> None:
        self._start_time, self._period = start_time, period
        self._tolerated, self._start_periods = tolerated, start_periods
        self.restart()

    def restart(self) -> None:
        """Begin again with the next measurement."""
        self._last: Measurement | None = None
        self._offset, self._standing, self._moved = 0.0, 0, False

    def time(self, measurement: Measurement) -> float:
        """Return the controller's time of the last measurement [s]."""
        return measurement.t + self._offset

    def fault(self, measurement: Measurement) -> str | None:
        """Return why the clock cannot be right at a new measurement, or None."""
        last, self._last = self._last, measurement
        if last is None:
            self._offset = self._start_time - measurement.t
            return None
        passed, period = measurement.t - last.t, self._period
        states = measurement.sequence - last.sequence
        longest = (max(states, self._tolerated + 1) + 1) * period
        if not 0.0 <= passed <= longest:
            self._offset -= passed - period
            return (
                f"the robot's clock jumps by {passed:.6g} s from one state to the "
                f"next; {longest:.3g} s are allowed"
            )
        self._moved |= passed > 0.0
        self._standing = 0 if passed > 0.0 else self._standing + 1
        allowed = self._tolerated if self._moved else self._start_periods
        if self._standing > allowed:
            return f"the robot's clock stands still for {self._standing} states"
        return None


_READ_MARGIN = 0.5
"""How late a state may be before its period counts as one without a state [periods]."""


class StateReader:
    """Reads measurements in real time, and checks them."""

    def __init__(
        self,
        robot: Robot,
        limits: RobotLimits | None,
        hardware: Hardware,
        settings: LiveSettings,
        clock: Callable[[], float],
        start_time: float = 0.0,
    ) -> None:
        self._hardware, self._settings, self._clock = hardware, settings, clock
        self._robot, self._period = robot, hardware.period
        self._monitor = MeasurementMonitor(robot, limits, settings, self._period)
        self._reckoning = DeadReckoning(robot, self._period)
        self._frozen = FrozenState(robot, self._period, settings.missing)
        self._robot_clock = RobotClock(
            start_time,
            self._period,
            settings.missing,
            settings.start_timeout / self._period,
        )
        self._missing = 0
        # the new, valid measurement of this period, or None
        self.measurement: Measurement | None = None
        self.fault: str | None = None  # why the robot must be stopped, or None
        self.error: Exception | None = None  # what the hardware raised, or None
        self.connection_lost = False  # whether no state can arrive any more
        # when this period's state arrived, by the loop's clock [s]
        self.arrival = self._last_arrival = self._due = clock()
        # response times and deadline misses
        self.deadlines = Deadlines(hardware.period)

    @property
    def state(self) -> RobotState:
        """The robot's state, measured or predicted; its time is the controller's."""
        return self._reckoning.state

    @property
    def predicted_for(self) -> float:
        """Time since the last measurement [s]."""
        return self._reckoning.predicted_for

    def wait_for_first(self) -> Measurement:
        """Wait for the first state, and return it."""
        end = self._clock() + self._settings.start_timeout
        while (left := end - self._clock()) > 0.0:
            raw = self._hardware.read(left)
            if raw is None:
                continue
            try:
                measurement = valid_measurement(raw, self._robot, self._period)
                fault = self._monitor.violation(measurement)
            except HardwareError as error:
                fault = str(error)
            if fault is not None:
                raise HardwareError(f"the robot cannot be started: {fault}")
            self._robot_clock.fault(measurement)
            self._accept(measurement)
            return measurement
        raise HardwareError(
            f"no state of the robot arrived in {self._settings.start_timeout:g} s"
        )

    def start(self) -> None:
        """Start real-time operation; states skipped before do not count."""
        self._monitor.last = None
        self._robot_clock.restart()
        self._last_arrival = self._clock()
        self._due = self._last_arrival + (1.0 + _READ_MARGIN) * self._period

    def read(self, applied: Array, limits: RobotLimits | None) -> None:
        """Read the period's measurement; predict the state if there is none."""
        self._monitor.follow(limits)
        self.fault = self.error = self.measurement = None
        new = self._newest(applied)
        if new is None:
            self._predict(applied)
            return
        if (last := self._monitor.last) is not None:
            self.deadlines.skipped_states += new.sequence - last.sequence - 1
        self._accept(new)

    def effort_sent(self) -> float:
        """Record that the period's effort was sent; return the response time [s]."""
        response = self._clock() - self.arrival
        if self.measurement is not None:
            self.deadlines.add(self.arrival - self._last_arrival, response)
            self._last_arrival = self.arrival
            self._due = self.arrival + (1.0 + _READ_MARGIN) * self._period
        return response

    def _newest(self, applied: Array) -> Measurement | None:
        """Return the new measurement if it is the robot's state; set the fault."""
        try:
            raw = self._hardware.read(max(self._due - self._clock(), 0.0))
        except Exception as error:  # a driver may raise anything
            self.fault, self.error = f"no state can be read: {described(error)}", error
            self.connection_lost = True
            raw = None
        self.arrival = self._clock()
        if raw is None:
            return None
        try:
            new = valid_measurement(raw, self._robot, self._period)
        except HardwareError as error:
            self.fault, self.error = str(error), error
            return None
        if not self._monitor.is_new(new):
            return None
        self.fault = self._robot_clock.fault(new) or self._monitor.violation(new)
        untrue = self._frozen.fault(new, applied) or self._monitor.jump(new)
        if untrue is not None:
            self.fault = self.fault or untrue
            return None
        return new

    def _accept(self, measurement: Measurement) -> None:
        self._monitor.last = self.measurement = measurement
        self._missing = 0
        t = self._robot_clock.time(measurement)
        self._reckoning.correct(t, measurement.q, measurement.v)

    def _predict(self, applied: Array) -> None:
        self._reckoning.predict(applied)
        self._missing += 1
        self.deadlines.without_state += 1
        self._due = max(self._due + self._period, self._clock())
        if self.fault is None and self._missing > self._settings.missing:
            self.fault = f"no new state for {self._missing} periods"
