"""Local coordinates of a stream: linear ones, and a rotation vector.

About an orientation R_b, R = R_b exp(y). With y = 0 where a chart begins, y' is the
angular velocity and y'' the angular acceleration in R_b's axes, exactly; so a motion
that continues in another chart is C². Wherever |y| < 3π/2, measured in world axes,

    |ω| <= |y'|,   |ω'| <= |y''| + |y'|²/π,   |ω''| <= |y'''| + |y'||y''| + |y'|³/6

(`tests/unit/trajectories/test_streams.py` compares with 10⁵ random motions).
"""

from typing import Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.trajectories.orientation import OrientationSample
from hsp_control.trajectories.trajectory import TrajectorySample


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

    def rebased(self, state: State) -> State:
        """Return the same state in the chart in which its rotation vector is zero."""
        if not self.rotational:
            return state
        found = State.allocate(self.size)
        given = {"linear": self.linear, "state": vars(state), "out": vars(found)}
        engine.RebasedState(**given)()
        return found

    def write_orientation(self, state: State, out: OrientationSample) -> None:
        """Write R, ω and ω' of a state, in world axes."""
        n = self.linear
        y = TrajectorySample(state.x[n:], state.rate[n:], state.acceleration[n:])
        engine.OrientationOfChart(base=state.base, y=y, out=out)()
