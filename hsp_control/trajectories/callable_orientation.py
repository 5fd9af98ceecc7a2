"""Any Python function of time as an orientation."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.rotations import compose_back, log3
from hsp_control.declaration.quantities import Positive
from hsp_control.trajectories import checks, time_derivatives
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)


class CallableOrientation(OrientationTrajectory):
    """R(t) = f(t), with numerical ω and ω'.

    With y(τ) = log(R(t)ᵀ R(t + τ)), y'(0) and y''(0) are exactly the angular velocity
    and acceleration in the body frame. Both are central differences of sixth order over
    seven points (`time_derivatives`), with an error of about 1e-10 for rotations of a
    few rad/s. The function must be smooth, and defined three steps before and after
    every sampled time. For pickling it must be defined at the top level of a module.
    """

    function: Callable[[float], ArrayLike]
    """f, time [s] to a rotation matrix of shape (3, 3), body to world."""
    step: Positive = time_derivatives.STEP
    """Time between the seven points of the differences [s]."""

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R(t), ω(t) and ω'(t); see `OrientationTrajectory.sample`.

        Raises:
            TrajectoryError: If the function does not return a rotation matrix.
        """
        out = self._output(out)
        R = self._call(t)

        def relative_rotation(time: float) -> Array:
            between, y = np.empty((3, 3)), np.empty(3)
            compose_back(R, self._call(time), between)
            log3(between, y)
            return y

        velocity, acceleration = time_derivatives.both_derivatives(
            relative_rotation, t, self.step
        )
        out.rotation[:] = R
        out.angular_velocity[:] = R @ velocity
        out.angular_acceleration[:] = R @ acceleration
        return out

    def _call(self, t: float) -> Array:
        return checks.rotation(self.function(t), f"function({t:g})")
