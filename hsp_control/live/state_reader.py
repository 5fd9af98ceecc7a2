"""Reads the robot's state every period, checks it, and predicts missing ones."""

from collections.abc import Callable
from contextlib import nullcontext
from math import exp, inf, isfinite, ulp
from numbers import Integral, Real
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Flags
from hsp_control.common.errors import HardwareError, HspControlError
from hsp_control.constraints.limits import RobotLimits, own_limits
from hsp_control.control.measurement import Inertial
from hsp_control.engine import Dynamics
from hsp_control.live.hardware import Hardware, Measurement, described
from hsp_control.live.operator_requests import OPERATOR
from hsp_control.live.report import Deadlines
from hsp_control.live.settings import LiveSettings
from hsp_control.live.trusted_motion import TrustedMotion
from hsp_control.robot import Robot, RobotState


class DeadReckoning:
    """The last measured state, integrated with the model under the applied efforts.

    For a robot with a floating base the velocity is kept: the forces at its feet are
    unknown meanwhile, and without them the model would fall.
    """

    def __init__(
        self, robot: Robot, period: float, dynamics: Dynamics | None = None
    ) -> None:
        self._robot, self._period = robot, period
        self.state = RobotState(robot, dynamics)  # the state, measured or predicted
        self.predicted_for = 0.0  # time since the last measurement [s]

    def correct(self, t: float, q: Array, v: Array) -> None:
        """Set the state to a measurement."""
        self.state.update(t, q, v)
        self.predicted_for = 0.0

    def predict(self, tau: Array) -> None:
        """Integrate the state over one period under an effort, shape (nv,)."""
        state, h = self.state, self._period
        self.predicted_for += h
        v = state.v.copy()
        if not self._robot.unactuated:
            v += h * self._robot.forward_dynamics(state.q, state.v, tau, state.dynamics)
        if not np.isfinite(v).all():
            return
        try:
            state.update(state.t + h, self._robot.integrate(state.q, h * v), v)
        except HspControlError:  # too fast: the configuration would overflow
            return


_LARGEST_SPEED = 1e4
"""Maximum joint speed without a limit in the model [rad/s or m/s]."""
_LARGEST_POSITION = 1e6
"""Maximum magnitude of a joint position [rad or m]."""
_LARGEST_EFFORT = 1e9
"""Maximum magnitude of an effort or a force [N·m or N]."""
_LARGEST_FORCE = 1e6
"""Maximum magnitude of a specific force, also in an impact [m/s²]."""
_RESOLUTION = 1e-3
"""Maximum resolution of the robot's clock [periods]; a huge time has a coarser one."""


def valid_measurement(raw: object, robot: Robot, period: float) -> Measurement:
    """Return a measurement of finite plain types in separate arrays."""
    if not isinstance(raw, Measurement):
        raise HardwareError(
            f"read returned an object of type {type(raw).__name__}; needs a "
            "Measurement, or None"
        )
    try:
        return _checked(raw, robot, period)
    except (HardwareError, *OPERATOR):
        raise
    except BaseException as error:  # an array-like object may raise anything
        raise HardwareError(
            f"the state cannot be read: {type(error).__name__}"
        ) from error


def _checked(raw: Measurement, robot: Robot, period: float) -> Measurement:
    _check_type("sequence", raw.sequence, Integral, "an integer")
    _check_type("fault", raw.fault, str, "a text")
    t, age = _number("time", raw.t), _number("age", raw.age)
    if ulp(t) > _RESOLUTION * period:
        raise HardwareError(
            f"the state's time is {t:g} s, too large for periods of {period:g} s"
        )
    q = _vector("q", raw.q, robot.nq, _LARGEST_POSITION)
    v = _vector("v", raw.v, robot.nv, _LARGEST_SPEED)
    for start, size in robot.unit_blocks:
        norm = float(np.linalg.norm(q[start : start + size]))
        if abs(norm - 1.0) > 1e-6:
            raise HardwareError(
                f"q[{start}:{start + size}] of the state has norm {norm:.6g}; needs "
                "norm 1"
            )
    applied = raw.applied
    if applied is not None:
        applied = _vector("applied", applied, robot.nv, _LARGEST_EFFORT)
    return Measurement(
        int(raw.sequence),
        t,
        q,
        v,
        age,
        bool(raw.halted),
        applied,
        raw.fault,
        {
            frame: _vector(f"wrench at {frame}", wrench, 6, _LARGEST_EFFORT)
            for frame, wrench in raw.wrenches.items()
        },
        frozenset(raw.estimated),
        _inertial(raw.inertial),
    )


def _inertial(raw: Any) -> Inertial | None:
    if raw is None:
        return None
    _check_type("inertial", raw, Inertial, "an Inertial")
    return Inertial(
        raw.frame,
        _vector("angular velocity", raw.angular_velocity, 3, _LARGEST_SPEED),
        _vector("specific force", raw.specific_force, 3, _LARGEST_FORCE),
    )


def _number(what: str, value: Any) -> float:
    _check_type(what, value, Real, "a number")
    number = float(value)
    if not isfinite(number):
        raise HardwareError(f"the state's {what} is {number}")
    return number


def _check_type(what: str, value: object, kind: type, needed: str) -> None:
    if not isinstance(value, kind):
        given = type(value).__name__
        raise HardwareError(f"the state's {what} is of type {given}; needs {needed}")


def _vector(name: str, value: Any, size: int, largest: float) -> Array:
    given = np.asarray(value)
    if given.shape != (size,):
        raise HardwareError(
            f"the state's {name} has shape {given.shape}; needs ({size},)"
        )
    if given.dtype.kind not in "fiu":
        raise HardwareError(f"the state's {name} holds {given.dtype}; needs numbers")
    with nullcontext() if given.itemsize <= 8 else np.errstate(over="ignore"):
        vector: Array = given.astype(float)
    if np.abs(vector).max(initial=0.0) <= largest:  # NaN is not
        return vector
    finite = np.isfinite(vector)
    wrong = ~finite if not finite.all() else np.abs(vector) > largest
    where, fault = int(wrong.argmax()), "is absurd" if finite.all() else "is not finite"
    raise HardwareError(f"the state {fault}: {name}[{where}] is {vector[where]:g}")


_MOVED = 1e-3
"""Predicted motion above which an unchanged state is frozen [rad or m]."""


class FrozenState:
    """Compares an unchanged state with the motion predicted by the model.

    New measurements with the same q and v to the last bit are possible for a robot at
    rest. If their velocity is not 0, or their sensor has noise, the model predicts the
    motion of the robot meanwhile under the applied efforts.

    Such a state must not be used: damping an outdated velocity drives the robot
    backwards. A state with v = 0 in all joints is not judged: a robot held by its
    brakes or its friction looks the same.
    """

    def __init__(self, robot: Robot, period: float, tolerated: int) -> None:
        self._robot, self._tolerated = robot, tolerated
        self._reckoning = DeadReckoning(robot, period)
        self._last: Measurement | None = None
        self._same = 0

    def fault(self, measurement: Measurement, applied: Array) -> str | None:
        """Return why a new measurement cannot be the robot's state, or None."""
        last, self._last = self._last, measurement
        if last is None or not (
            np.array_equal(measurement.q, last.q)
            and np.array_equal(measurement.v, last.v)
            and measurement.v.any()
        ):
            self._same = 0
            return None
        if self._same == 0:
            self._reckoning.correct(last.t, last.q, last.v)
        self._same += 1
        self._reckoning.predict(applied)
        if self._same <= self._tolerated:
            return None
        reached = self._reckoning.state.q
        moved = np.abs(self._robot.difference(measurement.q, reached))
        i = int(moved.argmax())
        if moved[i] <= _MOVED:
            return None
        return (
            f"the state is frozen: it was the same {self._same + 1} times, while "
            f"{self._robot.dof_names[i]} moved by {moved[i]:.2g} by the model"
        )


class MeasurementMonitor:
    """Checks measurements: returns a reason to stop, or None."""

    def __init__(
        self,
        robot: Robot,
        limits: RobotLimits | None,
        settings: LiveSettings,
        period: float,
    ) -> None:
        self._robot, self._settings, self._period = robot, settings, period
        self._own = own_limits(robot) if limits is None else None
        self.last: Measurement | None = None  # the last valid measurement
        self._read(limits)

    def follow(self, limits: RobotLimits | None) -> None:
        """Check against the controller's present limits, which may change in a run."""
        if limits is not self._limits:
            self._read(limits)

    def _read(self, limits: RobotLimits | None) -> None:
        self._limits, settings = limits, self._settings
        both = [each for each in (limits, self._own) if each is not None]
        lower = np.max([each.lower for each in both], axis=0)
        upper = np.min([each.upper for each in both], axis=0)
        speed = np.min([each.velocity for each in both], axis=0)
        self._lower = lower - settings.position_margin
        self._upper = upper + settings.position_margin
        self._speed = speed * (1.0 + settings.velocity_margin)

    def is_new(self, measurement: Measurement) -> bool:
        """Return whether the measurement is later than the last one."""
        return self.last is None or measurement.sequence > self.last.sequence

    def jumps(
        self, measurement: Measurement, judged: Flags
    ) -> tuple[Flags, str | None]:
        """Return the joints that cannot have moved here from the last state, and why.

        ``judged`` selects the joints, shape (nv,).
        """
        last = self.last
        if last is None:
            return np.zeros(self._robot.nv, dtype=bool), None
        passed = max(measurement.t - last.t, 0.0)
        passed = max(passed, (measurement.sequence - last.sequence) * self._period)
        moved = self._robot.difference(last.q, measurement.q) * judged
        furthest = self._speed * passed + self._settings.position_margin
        why = self._outside(moved, -furthest, furthest, "jumps by")
        return np.abs(moved) > furthest, why

    def violation(self, measurement: Measurement) -> str | None:
        """Return why the loop must stop at a valid state, or None."""
        last, allowed = self.last, self._settings
        if measurement.fault:
            return measurement.fault
        if measurement.halted:
            return "the robot has stopped by itself"
        if not abs(measurement.age) <= allowed.age:
            return (
                f"the state is {measurement.age:.3g} s old; {allowed.age:g} s are "
                "allowed"
            )
        if last is not None:
            skipped = measurement.sequence - last.sequence - 1
            if skipped > allowed.missing:
                return (
                    f"{skipped} states in a row were not received; {allowed.missing} "
                    "are allowed"
                )
        positions = self._robot.joint_positions(measurement.q)
        return self._outside(positions, self._lower, self._upper, "is at") or (
            self._outside(measurement.v, -self._speed, self._speed, "moves at")
        )

    def _outside(
        self, values: Array, lower: Array, upper: Array, verb: str
    ) -> str | None:
        outside = (values < lower) | (values > upper)
        if not outside.any():
            return None
        i = int(np.flatnonzero(outside)[0])
        return (
            f"{self._robot.dof_names[i]} {verb} {values[i]:.6g}, outside "
            f"{lower[i]:.6g} to {upper[i]:.6g}"
        )


class RobotClock:
    """Converts the robot's time to the controller's, and checks its steps.

    Between two measurements the robot's clock may advance by the periods given by their
    sequence numbers, or by the tolerated number of missing states. It may stand still
    before the robot starts, and for the tolerated number of states later. In some
    hundred states it must not gain or lose more than that either. The clock of a robot
    in real time must not run faster than ours; a slower one shows in the numbers of
    states, or belongs to a robot that was delayed.

    After a jump the controller's time advances by one period, which is sufficient for
    the safe stop.
    """

    def __init__(
        self,
        start_time: float,
        period: float,
        tolerated: int,
        start_periods: float,
        *,
        real_time: bool = False,
    ) -> None:
        self._start_time, self._period = start_time, period
        self._tolerated, self._start_periods = tolerated, start_periods
        self._real_time = real_time
        self.restart()

    def restart(self) -> None:
        """Begin again with the next measurement."""
        self._last: Measurement | None = None
        self._offset, self._standing, self._moved = 0.0, 0, False
        self._gained = 0.0  # by the clock, relative to the number of states [s]
        self._lead = self._lead_before = -inf  # the greatest lead relative to ours [s]
        self._window_end = -inf
        self.right = True  # whether it has always been right

    def time(self, measurement: Measurement) -> float:
        """Return the controller's time of the last measurement [s]."""
        return measurement.t + self._offset

    def fault(self, measurement: Measurement, arrival: float) -> str | None:
        """Return why the clock cannot be right at a new measurement, or None.

        ``arrival`` is its time of arrival, by our clock [s].
        """
        last, self._last = self._last, measurement
        if last is None:
            self._offset = self._start_time - measurement.t
            return None
        fault = self._step_fault(measurement, last) or self._runs_fast(
            measurement.t, arrival
        )
        self.right &= fault is None
        return fault

    def passed(self, measurement: Measurement, last: Measurement) -> float:
        """Return the time between two states [s], by their numbers if it was wrong."""
        states = measurement.sequence - last.sequence
        return measurement.t - last.t if self.right else states * self._period

    def _runs_fast(self, t: float, arrival: float) -> str | None:
        """Compare the clock with ours: delays make it late, never early."""
        if not (self._real_time and self._moved):
            return None
        lead = t - arrival
        if arrival > self._window_end:
            self._lead_before, self._lead = self._lead, -inf
            self._window_end = arrival + _CLOCK_WINDOW
        self._lead = max(self._lead, lead)
        gained = lead - self._lead_before
        if self._lead_before == -inf or gained <= _LARGEST_LEAD:
            return None
        return (
            f"the robot's clock runs faster than this computer's: it has gained "
            f"{gained:.3g} s within {_CLOCK_WINDOW:g} s"
        )

    def _step_fault(self, measurement: Measurement, last: Measurement) -> str | None:
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
        if not self._moved:
            return None
        leak = exp(-states / _CLOCK_STATES)
        self._gained = leak * self._gained + passed - states * period
        if abs(self._gained) <= (self._tolerated + 1) * period:
            return None
        gained, self._gained = self._gained, 0.0
        return (
            f"the robot's clock does not fit the number of its states: it has gained "
            f"{gained:.3g} s within some {_CLOCK_STATES} periods of {period:g} s"
        )


_CLOCK_STATES = 100
"""Number of states after which the gain of the robot's clock is weighted less."""
_CLOCK_WINDOW = 2.0
"""Duration of a comparison of a robot's clock with ours [s]."""
_LARGEST_LEAD = 0.1
"""Maximum gain from one such window to the next [s]."""


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
