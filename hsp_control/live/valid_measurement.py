"""Turn what a robot's `read` returned into a measurement that the loop can trust."""

from contextlib import nullcontext
from math import isfinite, ulp
from numbers import Integral, Real
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError
from hsp_control.control.measurement import Inertial
from hsp_control.live.hardware import Measurement
from hsp_control.robot import Robot

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
