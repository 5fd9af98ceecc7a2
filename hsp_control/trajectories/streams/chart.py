"""Local coordinates of what a stream moves: linear ones, and a rotation vector.

About an orientation R_b, R = R_b exp(y). With y = 0 where a chart begins, y' is the
angular velocity and y'' the angular acceleration in R_b's axes, exactly; so a motion
that continues in another chart is C². Wherever |y| < 3π/2, measured in world axes,

    |ω| <= |y'|,   |ω'| <= |y''| + |y'|²/π,   |ω''| <= |y'''| + |y'||y''| + |y'|³/6

(`tests/unit/trajectories/test_streams.py` compares with 10⁵ random motions).
"""

from math import pi

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import multiply
from hsp_control.compiled.rotations import (
    compose,
    compose_back,
    exp3,
    jexp3,
    jexp3_dot,
    jlog3,
    log3,
    rotate,
    rotate_back,
    rotation_from_quaternion,
)
from hsp_control.trajectories.orientation import OrientationSample


class State:
    """x, x' and x'' in local coordinates, in order: linear, then a rotation vector."""

    def __init__(self, x: Array, rate: Array, acceleration: Array, base: Array) -> None:
        """Keep the arrays."""
        self.x, self.rate, self.acceleration = x, rate, acceleration
        self.base = base


class Chart:
    """Converts values of a stream to local coordinates about a base, and back."""

    def __init__(self, linear: int, rotational: bool) -> None:
        """Set the number of linear coordinates, and whether a rotation follows."""
        self.linear, self.rotational = linear, rotational
        self.size = linear + 3 * rotational
        self._work = np.zeros((9, 3))

    def begin(self, linear: Array, rotation: Array) -> State:
        """Return the state at rest at a point and an orientation."""
        x = np.concatenate([linear, np.zeros(3 * self.rotational)])
        rest = np.zeros(self.size)
        return State(x, rest, rest.copy(), rotation.copy())

    def rebased(self, state: State) -> State:
        """Return the same state in the chart in which its rotation vector is zero."""
        if not self.rotational:
            return state
        n = self.linear
        sample = OrientationSample.allocate()
        self.write_orientation(state, sample)
        x, rate = state.x.copy(), state.rate.copy()
        acceleration = state.acceleration.copy()
        x[n:] = 0.0
        rotate_back(sample.rotation, sample.angular_velocity, rate[n:])
        rotate_back(sample.rotation, sample.angular_acceleration, acceleration[n:])
        return State(x, rate, acceleration, sample.rotation)

    def write_orientation(self, state: State, out: OrientationSample) -> None:
        """Write R, ω and ω' of a state, in world axes."""
        n = self.linear
        _orientation(
            *(state.base, state.x[n:], state.rate[n:], state.acceleration[n:]),
            *(self._work, *out),
        )

    def local(self, values: Array, base: Array) -> Array:
        """Return values, (k, width), in local coordinates about a base, (k, n).

        Rotation vectors continue each other beyond π.
        """
        x = np.empty((len(values), self.size))
        n = self.linear
        x[:, :n] = values[:, :n]
        if self.rotational:
            _rotation_vectors(values[:, n:], base, self._work, x[:, n:])
        return x

    def local_rate(self, x: Array, velocity: Array, base: Array) -> Array:
        """Return x' at x for a velocity in world axes, each of shape (n,)."""
        rate = velocity.copy()
        if self.rotational:
            n = self.linear
            _rotation_rate(x[n:], velocity[n:], base, self._work, rate[n:])
        return rate


@kernel
def _orientation(
    base: Array,
    y: Array,
    y_dot: Array,
    y_ddot: Array,
    work: Array,
    rotation: Array,
    velocity: Array,
    acceleration: Array,
) -> None:
    """Write R = R_b exp(y), ω = R Jexp y' and ω' = R (Jexp y'' + Jexp' y')."""
    turned, J, moved = work[0:3], work[3:6], work[6]
    exp3(y, turned)
    compose(base, turned, rotation)
    jexp3(y, J)
    multiply(J, y_dot, velocity)
    multiply(J, y_ddot, acceleration)
    jexp3_dot(y, y_dot, J)
    multiply(J, y_dot, moved)
    for i in range(3):
        acceleration[i] += moved[i]
    rotate(rotation, velocity, velocity)
    rotate(rotation, acceleration, acceleration)


@kernel
def _rotation_vectors(quaternions: Array, base: Array, work: Array, y: Array) -> None:
    """Write log(R_bᵀ R) of each row, on the branch nearest to the row before."""
    R, away = work[0:3], work[3:6]
    for k in range(quaternions.shape[0]):
        rotation_from_quaternion(quaternions[k], R)
        compose_back(base, R, away)
        log3(away, y[k])
        if k == 0:
            continue
        angle, along = 0.0, 0.0
        for i in range(3):
            angle += y[k, i] * y[k, i]
            along += y[k, i] * y[k - 1, i]
        angle = np.sqrt(angle)
        if angle > 0.0:  # y and y (1 - 2π/|y|) are the same rotation
            turns = np.round((angle - along / angle) / (2.0 * pi))
            for i in range(3):
                y[k, i] *= 1.0 - 2.0 * pi * turns / angle


@kernel
def _rotation_rate(
    y: Array, omega: Array, base: Array, work: Array, rate: Array
) -> None:
    """Write y' = Jlog(y) Rᵀ ω."""
    R, turned, J, body = work[0:3], work[3:6], work[3:6], work[6]
    exp3(y, turned)
    compose(base, turned, R)
    rotate_back(R, omega, body)
    jlog3(y, J)
    multiply(J, body, rate)
