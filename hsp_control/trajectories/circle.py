"""A circle at constant speed, in the plane, in space or in any Rⁿ."""

from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError
from hsp_control.common.kernels import kernel
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.trajectory import Trajectory


class Circle(Compiled, Trajectory):
    """x(t) = c + r (cos θ u1 + sin θ u2), θ = ω t + θ0, for all t.

    The paper's (1 + cos 3t, 1 + sin 3t) is ``Circle([1, 1], 1, 3)``.

    Attributes:
        center: c, shape (n,).
        radius: r > 0.
        angular_rate: ω [rad/s].
        phase: θ0 [rad].
        axes: u1 and u2, orthonormal, shape (2, n).
    """

    __slots__ = ("_arms", "angular_rate", "axes", "center", "phase", "radius")

    def __init__(
        self,
        center: ArrayLike,
        radius: float,
        angular_rate: float,
        phase: float = 0.0,
        *,
        axes: ArrayLike | None = None,
        normal: ArrayLike | None = None,
        start: ArrayLike | None = None,
    ) -> None:
        """Lay the circle into the plane of ``axes``, or across ``normal``.

        Args:
            center: c, shape (n,).
            radius: r > 0.
            angular_rate: ω [rad/s].
            phase: θ0 [rad].
            axes: u1 and u2, orthonormal, shape (2, n); in the plane x and y by default.
            normal: In space, instead of ``axes``: the vector about which the point
                turns with the right hand when ω > 0, shape (3,).
            start: With ``normal``: where u1 points, as seen along it, shape (3,); the
                world axis that is most nearly across by default.
        """
        self.center = checks.array(center, "center", (None,))
        self.radius = checks.positive(radius, "radius")
        self.angular_rate = checks.number(angular_rate, "angular_rate")
        self.phase = checks.number(phase, "phase")
        self.axes = _plane(self.dimension, axes, normal, start)
        self._arms = self.radius * self.axes

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return len(self.center)

    def _kernel(self) -> Kernel:
        return _circle, (self.angular_rate, self.phase, self.center, self._arms)


def _plane(
    n: int, axes: ArrayLike | None, normal: ArrayLike | None, start: ArrayLike | None
) -> Array:
    """Return u1 and u2, shape (2, n), however they were given.

    Raises:
        TrajectoryError: If they were not given, or given twice.
    """
    if normal is None:
        if start is not None:
            raise TrajectoryError("start goes with normal; axes say it already")
        if axes is not None:
            return checks.orthonormal(axes, "axes", (2, n))
        if n == 2:
            return np.eye(2)
        choice = "axes or a normal" if n == 3 else "axes"
        raise TrajectoryError(f"a circle in dimension {n} needs {choice}")
    if axes is not None:
        raise TrajectoryError("give axes or a normal, not both")
    if n != 3:
        raise TrajectoryError(f"a normal is for dimension 3; center has dimension {n}")
    return _across(checks.direction(normal, "normal"), start)


def _across(normal: Array, start: ArrayLike | None) -> Array:
    """Return u1 and u2 = normal x u1, shape (2, 3); ``normal`` has length 1.

    Raises:
        TrajectoryError: If ``start`` points along ``normal``.
    """
    if start is None:
        first = np.eye(3)[np.argmin(np.abs(normal))]
    else:
        first = checks.direction(start, "start")
    first = first - (first @ normal) * normal
    length = float(np.linalg.norm(first))
    if length < 1e-6:
        raise TrajectoryError(
            f"start must not point along normal; both are along {normal.tolist()}"
        )
    first /= length
    return np.stack([first, np.cross(normal, first)])


@kernel
def _circle(
    rate: float,
    phase: float,
    center: Array,
    arms: Array,
    position: Array,
    velocity: Array,
    acceleration: Array,
    t: float,
) -> None:
    cosine, sine = cos(rate * t + phase), sin(rate * t + phase)
    for i in range(center.size):
        outward = cosine * arms[0, i] + sine * arms[1, i]
        forward = cosine * arms[1, i] - sine * arms[0, i]
        position[i] = center[i] + outward
        velocity[i] = rate * forward
        acceleration[i] = -rate * rate * outward
