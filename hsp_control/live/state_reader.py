"""Read the robot's state each period; predict it when no new measurement arrives."""

from collections.abc import Callable

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError
from hsp_control.constraints.limits import RobotLimits
from hsp_control.live.dead_reckoning import DeadReckoning
from hsp_control.live.deadlines import Deadlines
from hsp_control.live.hardware import Hardware, Measurement
from hsp_control.live.measurement_monitor import MeasurementMonitor
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot, RobotState

_READ_MARGIN = 0.5
"""How late a state may be before its period counts as one without a state [periods]."""


class StateReader:
    """Reads measurements in real time, and checks them.

    Attributes:
        measurement: The new, valid measurement of this period, or None.
        fault: Why the robot must be stopped, or None.
        error: What the hardware raised, or None.
        connection_lost: Whether no state can arrive any more.
        arrival: When this period's state arrived, by the loop's clock [s].
        deadlines: Response times and deadline misses.
    """

    def __init__(
        self,
        robot: Robot,
        limits: RobotLimits | None,
        hardware: Hardware,
        settings: LiveSettings,
        clock: Callable[[], float],
    ) -> None:
        """Allocate.

        Args:
            robot: The model.
            limits: The controller's limits; None: those of the robot's model.
            hardware: The robot.
            settings: Faults that are tolerated.
            clock: A monotonic clock [s].
        """
        self._hardware, self._settings, self._clock = hardware, settings, clock
        self._monitor = MeasurementMonitor(robot, limits, settings)
        self._reckoning = DeadReckoning(robot, hardware.period)
        self._period = hardware.period
        self._missing = 0
        self._time_offset = 0.0
        self.measurement: Measurement | None = None
        self.fault: str | None = None
        self.error: Exception | None = None
        self.connection_lost = False
        self.arrival = self._last_arrival = self._due = clock()
        self.deadlines = Deadlines(hardware.period)

    @property
    def state(self) -> RobotState:
        """The robot's state, measured or predicted; its time is the controller's."""
        return self._reckoning.state

    @property
    def predicted_for(self) -> float:
        """Time since the last measurement [s]."""
        return self._reckoning.predicted_for

    def wait_for_first(self, start_time: float) -> Measurement:
        """Wait for the first state, and return it.

        Args:
            start_time: The controller's time at this state [s].

        Raises:
            HardwareError: If none arrives in time, or the robot cannot be started.
        """
        end = self._clock() + self._settings.start_timeout
        while (left := end - self._clock()) > 0.0:
            measurement = self._hardware.read(left)
            if measurement is None:
                continue
            monitor = self._monitor
            fault = monitor.invalid(measurement) or monitor.violation(measurement)
            if fault is not None:
                raise HardwareError(f"the robot cannot be started: {fault}")
            self._time_offset = start_time - measurement.t
            self._accept(measurement)
            return measurement
        raise HardwareError(
            f"no state of the robot arrived in {self._settings.start_timeout:g} s"
        )

    def start(self) -> None:
        """Start real-time operation; states skipped before do not count."""
        self._monitor.last = None
        self._last_arrival = self._clock()
        self._due = self._last_arrival + (1.0 + _READ_MARGIN) * self._period

    def read(self, applied: Array, limits: RobotLimits | None) -> None:
        """Read the period's measurement; predict the state if there is none.

        Args:
            applied: The effort that the motors apply, shape (nv,).
            limits: The controller's limits of now; None: those of the robot's model.
        """
        self._monitor.follow(limits)
        self.fault = self.error = self.measurement = None
        raw = self._read()
        if raw is not None:
            self.fault = self._monitor.invalid(raw)
        new = self._monitor.if_new(raw) if self.fault is None else None
        self.arrival = self._clock()
        if new is None:
            self._predict(applied)
            return
        self.fault = self._monitor.violation(new)
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

    def _read(self) -> Measurement | None:
        try:
            return self._hardware.read(max(self._due - self._clock(), 0.0))
        except (HardwareError, OSError) as error:
            self.fault, self.error = f"no state can be read: {error}", error
            self.connection_lost = True
            return None

    def _accept(self, measurement: Measurement) -> None:
        self._monitor.last = self.measurement = measurement
        self._missing = 0
        t = measurement.t + self._time_offset
        self._reckoning.correct(t, measurement.q, measurement.v)

    def _predict(self, applied: Array) -> None:
        self._reckoning.predict(applied)
        self._missing += 1
        self.deadlines.without_state += 1
        self._due = max(self._due + self._period, self._clock())
        if self.fault is None and self._missing > self._settings.missing:
            self.fault = f"no new state for {self._missing} periods"
