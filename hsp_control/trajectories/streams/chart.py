"""Local coordinates of a stream: linear ones, and a rotation vector.

About an orientation R_b, R = R_b exp(y). With y = 0 where a chart begins, y' is the
angular velocity and y'' the angular acceleration in R_b's axes, exactly; so a motion
that continues in another chart is C². Wherever |y| < 3π/2, measured in world axes,

    |ω| <= |y'|,   |ω'| <= |y''| + |y'|²/π,   |ω''| <= |y'''| + |y'||y''| + |y'|³/6

(`tests/unit/trajectories/test_streams.py` compares with 10⁵ random motions).
"""

from typing import Any, Self

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.engine.plans import TIME, AnyCall, PartCall, PartCalls
from hsp_control.engine.rotations import exp3
from hsp_control.trajectories.orientation import OrientationSample
from hsp_control.trajectories.pose import PoseSample
from hsp_control.trajectories.trajectory import TrajectorySample

_NEAR = 1e-3  # [m, or the stream's unit, or rad]


class State:
    """x, x' and x'' in local coordinates, in order: linear, then a rotation vector."""

    def __init__(self, x: Array, rate: Array, acceleration: Array, base: Array) -> None:
        """Store the arrays."""
        self.x, self.rate, self.acceleration = x, rate, acceleration
        self.base = base

    @classmethod
    def allocate(cls, n: int) -> Self:
        """Return a state of zeros with n coordinates."""
        return cls(np.zeros(n), np.zeros(n), np.zeros(n), np.eye(3))

    def rotation_vector(self, linear: int) -> TrajectorySample:
        """Return views of y, y' and y'', which follow the linear coordinates."""
        return TrajectorySample(
            self.x[linear:], self.rate[linear:], self.acceleration[linear:]
        )


class Chart:
    """Converts values of a stream to local coordinates about a base, and back."""

    def __init__(self, linear: int, rotational: bool) -> None:
        """Set the number of linear coordinates, and whether a rotation follows."""
        self.linear, self.rotational = linear, rotational
        self.size = linear + 3 * rotational

    def begin(self, linear: Array, rotation: Array) -> State:
        """Return the state at rest at a point and an orientation."""
        x = np.concatenate([linear, np.zeros(3 * self.rotational)])
        rest = np.zeros(self.size)
        return State(x, rest, rest.copy(), rotation.copy())

    def value(self, state: State) -> Array:
        """Return a state at the base of its chart as a stream's value."""
        return self._value(state.x, state.base)

    def value_near(self, state: State) -> Array:
        """Return another value than that of a state, not far from it."""
        return self._value(state.x + _NEAR, state.base @ exp3(np.full(3, _NEAR)))

    def _value(self, x: Array, rotation: Array) -> Array:
        value: Array = x[: self.linear].copy()
        if self.rotational:
            value = np.append(value, pin.Quaternion(rotation).coeffs())
        return value

    def calls(self, state: State, out: Any) -> PartCalls:
        """Return the calls that write a sample of a state, of whatever the chart moves.

        Args:
            state: The state, which is written before, at a `TIME`.
            out: A `TrajectorySample`, an `OrientationSample` or a `PoseSample`.
        """
        n, found = self.linear, list[AnyCall]()
        for part in out if isinstance(out, PoseSample) else (out,):
            if isinstance(part, OrientationSample):
                given = {"base": state.base, "y": state.rotation_vector(n), "out": part}
                found.append(PartCall(engine.OrientationOfChart, t=TIME, **given))
                continue
            arrays = state.x, state.rate, state.acceleration
            for own, other in zip(arrays, part, strict=True):
                found.append(PartCall(engine.Copy, x=own[:n], out=other, t=TIME))
        return found
