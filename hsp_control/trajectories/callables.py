"""Trajectories given by Python functions of time.

Derivatives are central differences of sixth order, of seven values at t + k h,
k = -3 .. 3. The truncation error of the first one is h⁶ f⁽⁷⁾ / 140, of the second one
h⁶ f⁽⁸⁾ / 560; rounding adds up to 2 ε |f| / h and 6 ε |f| / h², with ε = 1.1e-16. With
the default step of 5 ms the error of the second derivative is 3e-11 for a sine of
1 rad/s, and 3e-9 for a sine of 10 rad/s, whose second derivative has the amplitude 1e2.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Positive, PositiveCount
from hsp_control.engine.rotations import log3
from hsp_control.trajectories import checks
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample

PointFunction = Callable[[float], ArrayLike]

STEP = 5e-3  # default step h [s]
_OFFSETS = (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0)
_FIRST = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
_SECOND = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0


def first_derivative(
    function: Callable[[float], Array], t: float, step: float
) -> Array:
    """Return f'(t) of a function with values of shape (n,); ``step`` is h [s]."""
    values = np.stack([function(t + k * step) for k in _OFFSETS])
    return _FIRST @ values / step


def both_derivatives(
    function: Callable[[float], Array], t: float, step: float
) -> tuple[Array, Array]:
    """Return f'(t) and f''(t), shapes (n,); ``step`` is h [s]."""
    values = np.stack([function(t + k * step) for k in _OFFSETS])
    return _FIRST @ values / step, _SECOND @ values / (step * step)


class CallableTrajectory(Trajectory):
    """x(t) = f(t); omitted derivatives are numerical.

    They are central differences of sixth order over seven points,
    with an error of about 1e-10 for motions of a few rad/s. The function must be
    smooth, and defined three steps before and after every sampled time. For pickling it
    must be defined at the top level of a module.
    """

    function: PointFunction
    """f, time [s] to a point of shape (n,)."""
    dimension: PositiveCount
    """The number n of coordinates [-]."""
    velocity: PointFunction | None = None
    """f', time [s] to shape (n,), if known."""
    acceleration: PointFunction | None = None
    """f'', time [s] to shape (n,), if known."""
    step: Positive = STEP
    """Time between the seven points of the differences [s]."""

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x(t), x'(t) and x''(t); see `Trajectory.sample`."""
        out = self._output(out)
        velocity, acceleration = self._rates(t)
        out.position[:] = self._call(self.function, "function", t)
        out.velocity[:] = velocity
        out.acceleration[:] = acceleration
        return out

    def _rates(self, t: float) -> tuple[Array, Array]:
        """Return f' and f'', from the highest given derivative."""
        f, v, a = self.function, self.velocity, self.acceleration
        if v is None:
            rates = both_derivatives(
                lambda s: self._call(f, "function", s), t, self.step
            )
            return rates if a is None else (rates[0], self._call(a, "acceleration", t))
        if a is None:
            return self._call(v, "velocity", t), first_derivative(
                lambda s: self._call(v, "velocity", s), t, self.step
            )
        return self._call(v, "velocity", t), self._call(a, "acceleration", t)

    def _call(self, function: PointFunction, name: str, t: float) -> Array:
        return checks.array(function(t), f"{name}({t:g})", (self.dimension,))


class CallableOrientation(OrientationTrajectory):
    """R(t) = f(t), with numerical ω and ω'.

    With y(τ) = log(R(t)ᵀ R(t + τ)), y'(0) and y''(0) are exactly the angular velocity
    and acceleration in the body frame. Both are central differences of sixth order over
    seven points, with an error of about 1e-10 for rotations of a
    few rad/s. The function must be smooth, and defined three steps before and after
    every sampled time. For pickling it must be defined at the top level of a module.
    """

    function: Callable[[float], ArrayLike]
    """f, time [s] to a rotation matrix of shape (3, 3), body to world."""
    step: Positive = STEP
    """Time between the seven points of the differences [s]."""

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R(t), ω(t) and ω'(t); see `OrientationTrajectory.sample`."""
        out = self._output(out)
        R = self._call(t)

        def relative_rotation(time: float) -> Array:
            return log3(R.T @ self._call(time))

        velocity, acceleration = both_derivatives(relative_rotation, t, self.step)
        out.rotation[:] = R
        out.angular_velocity[:] = R @ velocity
        out.angular_acceleration[:] = R @ acceleration
        return out

    def _call(self, t: float) -> Array:
        return checks.rotation(self.function(t), f"function({t:g})")
