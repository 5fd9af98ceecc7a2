"""What is wrong with a measurement: invalid, late, frozen or beyond the limits."""

from contextlib import nullcontext
from math import isfinite, ulp
from numbers import Integral, Real
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError, HspControlError
from hsp_control.constraints.limits import RobotLimits, own_limits
from hsp_control.control.measurement import Inertial
from hsp_control.live.hardware import Measurement
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot, RobotState


class DeadReckoning:
    """The last measured state, integrated with the model under the applied efforts.

    Of a robot with a floating base the velocity is kept: nobody knows what its feet
    push meanwhile, and without them the model would fall.
    """

    def __init__(self, robot: Robot, period: float) -> None:
        self._robot, self._period = robot, period
        self.state = RobotState(robot)  # the state, measured or predicted
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
            v += h * self._robot.forward_dynamics(state.q, state.v, tau)
        if not np.isfinite(v).all():
            return
        try:
            state.update(state.t + h, self._robot.integrate(state.q, h * v), v)
        except HspControlError:  # too fast: the configuration would overflow
            return


_LARGEST_SPEED = 1e4
"""No joint moves faster [rad/s or m/s]: it holds where the model has no limit."""
_LARGEST_POSITION = 1e6
"""No joint is further away, or was turned further [rad or m]."""
_LARGEST_EFFORT = 1e9
"""No motor has a larger effort, and nothing is pressed harder [N·m or N]."""
_LARGEST_FORCE = 1e6
"""No specific force is larger, in an impact either [m/s²]."""
_RESOLUTION = 1e-3
"""Coarsest step of the robot's clock [periods]; a huge time has coarser ones."""


def valid_measurement(raw: object, robot: Robot, period: float) -> Measurement:
    """Return a measurement of finite plain types in arrays that nobody else writes."""
    if not isinstance(raw, Measurement):
        raise HardwareError(
            f"read returned an object of type {type(raw).__name__}; needs a "
            "Measurement, or None"
        )
    try:
        return _checked(raw, robot, period)
    except HardwareError:
        raise
    except Exception as error:  # an array-like object may raise anything
        raise HardwareError(
            f"the state cannot be read: {type(error).__name__}"
        ) from error


def _checked(raw: Measurement, robot: Robot, period: float) -> Measurement:
    if not isinstance(raw.sequence, Integral):
        raise HardwareError(
            f"the state's sequence is of type {type(raw.sequence).__name__}; needs an "
            "integer"
        )
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
    applied: Array | None = None
    if raw.applied is not None:
        applied = _vector("applied", raw.applied, robot.nv, _LARGEST_EFFORT)
    if not isinstance(raw.fault, str):
        raise HardwareError(
            f"the state's fault is of type {type(raw.fault).__name__}; needs a text"
        )
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
    if not isinstance(raw, Inertial):
        raise HardwareError(
            f"the state's inertial is of type {type(raw).__name__}; needs an Inertial"
        )
    return Inertial(
        raw.frame,
        _vector("angular velocity", raw.angular_velocity, 3, _LARGEST_SPEED),
        _vector("specific force", raw.specific_force, 3, _LARGEST_FORCE),
    )


def _number(what: str, value: Any) -> float:
    if type(value) is not float:
        if not isinstance(value, Real):
            raise HardwareError(
                f"the state's {what} is of type {type(value).__name__}; needs a number"
            )
        value = float(value)
    if not isfinite(value):
        raise HardwareError(f"the state's {what} is {value}")
    return float(value)


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
"""Motion by the model from which a state that stays the same is frozen [rad or m]."""


class FrozenState:
    """Compares a state that does not change with the motion that the model predicts.

    New measurements with the same q and v to the last bit are right for a robot that
    stands. If they have a velocity that is not 0, or come from a sensor with noise, the
    model says how far the robot went meanwhile under the efforts applied.

    Such a state must not be used: damping a velocity that is long gone drives the robot
    backwards. A state with v = 0 in all joints is not judged: a robot that its brakes
    or its friction hold looks the same.
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
    """Returns what is wrong with a measurement: a reason to stop, or None."""

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
        """Check against the controller's limits of now, which may change in a run."""
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

    def jump(self, measurement: Measurement) -> str | None:
        """Return why the robot cannot have come here from the last state, or None."""
        last = self.last
        if last is None:
            return None
        passed = max(measurement.t - last.t, 0.0)
        passed = max(passed, (measurement.sequence - last.sequence) * self._period)
        moved = self._robot.difference(last.q, measurement.q)
        furthest = self._speed * passed + self._settings.position_margin
        return self._outside(moved, -furthest, furthest, "jumps by")

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
