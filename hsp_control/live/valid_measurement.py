"""Measurements as a robot's driver returns them: their types, shapes and sizes."""

from contextlib import nullcontext
from math import isfinite, ulp
from numbers import Integral, Real
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.control.measurement import Inertial
from hsp_control.live.hardware import Measurement
from hsp_control.live.operator_requests import OPERATOR
from hsp_control.robot import Robot

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
