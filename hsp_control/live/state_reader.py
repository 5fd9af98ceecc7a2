"""Reads the robot's state every period, checks it, and predicts missing ones."""

from collections.abc import Callable

import numpy as np

from hsp_control.common.arrays import Array, Flags
from hsp_control.common.errors import HardwareError
from hsp_control.constraints.limits import RobotLimits
from hsp_control.engine import Dynamics
from hsp_control.live.dead_reckoning import DeadReckoning
from hsp_control.live.frozen_state import FrozenState
from hsp_control.live.hardware import Hardware, Measurement, described
from hsp_control.live.measurement_monitor import MeasurementMonitor
from hsp_control.live.operator_requests import OPERATOR
from hsp_control.live.report import Deadlines
from hsp_control.live.robot_clock import RobotClock
from hsp_control.live.settings import LiveSettings
from hsp_control.live.trusted_motion import TrustedMotion
from hsp_control.live.valid_measurement import valid_measurement
from hsp_control.robot import Robot, RobotState

_HELD, _LEAST_HELD = 0.01, 2
"""Duration of missing states over which an effort is held [s], two of them in any case
[periods]: an arm that accelerates gains less speed, and one lost state in ten does not
change a task's error at 1, 2 and 10 ms; at 5 ms, where sometimes three are lost in a
row, it becomes 0.6 mm instead of 0.1."""
_FEW = 5
"""Number of consecutive missing states after which a speed is the model's."""
_READ_MARGIN = 0.5
"""Maximum delay of a state before its period has none [periods]."""


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
        dynamics: Dynamics | None = None,
    ) -> None:
        self._hardware, self._settings, self._clock = hardware, settings, clock
        self._robot, self._period = robot, hardware.period
        self._monitor = MeasurementMonitor(robot, limits, settings, self._period)
        self._reckoning = DeadReckoning(robot, self._period, dynamics)
        self._frozen = FrozenState(robot, self._period, settings.missing)
        self._motion = TrustedMotion(robot, settings, self._period, dynamics)
        self._robot_clock = RobotClock(
            start_time,
            self._period,
            settings.missing,
            settings.start_timeout / self._period,
            real_time=bool(getattr(hardware, "real_time", False)),
        )
        self._missing = 0
        # what acts on the joints besides their efforts; see `LoadEstimate`
        self.load: Array = np.zeros(robot.nv)
        # the new, valid measurement of this period, or None
        self.measurement: Measurement | None = None
        self.fault: str | None = None  # why the robot must be stopped, or None
        self.error: BaseException | None = None  # raised by the hardware, or None
        self.connection_lost = False  # whether no state can arrive any more
        # arrival of this period's state, by the loop's clock [s]
        self.arrival = self._last_arrival = self._due = clock()
        self.deadlines = Deadlines(hardware.period)

    @property
    def state(self) -> RobotState:
        """The robot's state, measured or predicted; its time is the controller's."""
        return self._reckoning.state

    @property
    def predicted_for(self) -> float:
        """Time since the last measurement, of a joint or of all [s]."""
        return max(self._reckoning.predicted_for, self._motion.unknown_for)

    @property
    def blind(self) -> bool:
        """Whether states have been missing for too long for an effort to be held."""
        held = max(round(_HELD / self._period), _LEAST_HELD)
        return self._missing > held and not self._robot.unactuated

    @property
    def ambiguous(self) -> bool:
        """Whether it is unknown if a joint moves as measured."""
        return self._motion.ambiguous

    @property
    def silent(self) -> Flags:
        """Joints whose readings did not change by a bit, shape (nv,)."""
        return self._motion.silent

    @property
    def dead(self) -> Flags:
        """Joints whose sensors have died, shape (nv,)."""
        return self._motion.dead

    @property
    def speed(self) -> float:
        """Speed of the fastest joint, a mean of some milliseconds, or as predicted."""
        mean = self._motion.mean_velocity
        if mean is None or self._missing > _FEW:
            mean = self.state.v
        return float(np.abs(mean).max())

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
            self._robot_clock.fault(measurement, self._clock())
            self._accept(measurement)
            return measurement
        raise HardwareError(
            f"no state of the robot arrived in {self._settings.start_timeout:g} s"
        )

    def start(self) -> None:
        """Start real-time operation; states skipped before are ignored."""
        self._monitor.last = None
        self._motion.restart()
        self._robot_clock.restart()
        self._last_arrival = self._clock()
        self._due = self._last_arrival + (1.0 + _READ_MARGIN) * self._period

    def stop(self) -> None:
        """Begin braking the joints; see `TrustedMotion.stop`."""
        self._motion.stop()

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

    def effort_sent(self, applied: Array) -> float:
        """Record the effort that acts now, (nv,); return the response time [s]."""
        response = self._clock() - self.arrival
        state = self.state
        inertia = state.mass_matrix
        self._motion.applied(state.q, state.v, applied, self.load, inertia)
        if self.measurement is not None:
            self.deadlines.add(self.arrival - self._last_arrival, response)
            self._last_arrival = self.arrival
            self._due = self.arrival + (1.0 + _READ_MARGIN) * self._period
        return response

    def _newest(self, applied: Array) -> Measurement | None:
        """Return the new measurement if it is the robot's state; set the fault."""
        try:
            raw = self._hardware.read(max(self._due - self._clock(), 0.0))
        except OPERATOR:
            raise
        except BaseException as error:  # a driver may raise anything
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
        clock_fault = self._robot_clock.fault(new, self.arrival)
        self.fault = self._monitor.violation(new) or clock_fault
        frozen = self._frozen.fault(new, applied)
        trusted = self._trusted(new)
        if frozen is not None:
            self.fault = self.fault or frozen
            return None
        return trusted

    def _trusted(self, new: Measurement) -> Measurement | None:
        """Return the trusted part of a measurement; None if unused without a fault."""
        motion = self._motion
        last = motion.last
        passed = 0.0 if last is None else self._robot_clock.passed(new, last)
        jumps, why = self._monitor.jumps(new, motion.trusted_positions)
        trusted = motion.update(new, passed, jumps)
        self.fault = self.fault or why or motion.fault
        return None if motion.doubtful else trusted

    def _accept(self, measurement: Measurement) -> None:
        self._monitor.last = self.measurement = measurement
        self._missing = 0
        t = self._robot_clock.time(measurement)
        self._reckoning.correct(t, measurement.q, measurement.v)

    def _predict(self, applied: Array) -> None:
        self._reckoning.predict(applied + self.load)
        self._missing += 1
        self.deadlines.without_state += 1
        self._due = max(self._due + self._period, self._clock())
        if self.fault is None and self._missing > self._settings.missing:
            self.fault = f"no new state for {self._missing} periods"
