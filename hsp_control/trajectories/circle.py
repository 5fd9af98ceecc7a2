"""A circle at constant speed, in any Rⁿ with n ≥ 2."""

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

    __slots__ = ("_radii", "angular_rate", "axes", "center", "phase", "radius")

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
        """Set the circle; its plane is given by ``axes`` or by ``normal``.

        Args:
            center: c, shape (n,).
            radius: r > 0, in the units of the center.
            angular_rate: ω [rad/s].
            phase: θ0 [rad].
            axes: u1 and u2, orthonormal, shape (2, n); the x and y axes by default if
                n = 2.
            normal: For n = 3, instead of ``axes``: normal of the plane, of any length
                but zero, shape (3,). For ω > 0 the rotation about it is right-handed.
            start: With ``normal``: a vector whose projection onto the plane gives u1,
                shape (3,); by default the coordinate axis that is most nearly
                perpendicular to the normal.

        Raises:
            TrajectoryError: If the plane is missing or given twice, a shape does not
                fit, a value is not finite, the radius is not positive, the axes are not
                orthonormal, or ``start`` is parallel to ``normal``.
        """
        self.center = checks.array(center, "center", (None,))
        self.radius = checks.positive(radius, "radius")
        self.angular_rate = checks.number(angular_rate, "angular_rate")
        self.phase = checks.number(phase, "phase")
        self.axes = _plane(self.dimension, axes, normal, start)
        self._radii = self.radius * self.axes

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return len(self.center)

    def _kernel(self) -> Kernel:
        return _circle, (self.angular_rate, self.phase, self.center, self._radii)


def _plane(
    n: int, axes: ArrayLike | None, normal: ArrayLike | None, start: ArrayLike | None
) -> Array:
    """Return u1 and u2, shape (2, n), from ``axes``, or from ``normal`` and ``start``.

    Raises:
        TrajectoryError: If the plane is missing, or given twice.
    """
    if normal is None:
        if start is not None:
            raise TrajectoryError("start needs a normal; axes define the start already")
        if axes is not None:
            return checks.orthonormal(axes, "axes", (2, n))
        if n == 2:
            return np.eye(2)
        choice = "axes or a normal" if n == 3 else "axes"
        raise TrajectoryError(f"a circle in dimension {n} needs {choice}")
    if axes is not None:
        raise TrajectoryError("give axes or a normal, not both")
    if n != 3:
        raise TrajectoryError(f"a normal needs dimension 3; center has dimension {n}")
    return _axes_from_normal(checks.direction(normal, "normal"), start)


def _axes_from_normal(normal: Array, start: ArrayLike | None) -> Array:
    """Return u1 and u2 = normal × u1, shape (2, 3); ``normal`` has length 1.

    Raises:
        TrajectoryError: If ``start`` is parallel to ``normal``.
    """
    if start is None:
        first = np.eye(3)[np.argmin(np.abs(normal))]
    else:
        first = checks.direction(start, "start")
    first = first - (first @ normal) * normal
    length = float(np.linalg.norm(first))
    if length < 1e-6:
        raise TrajectoryError(
            "start must not be parallel to normal; both have the direction "
            f"{normal.tolist()}"
        )
    first /= length
    return np.stack([first, np.cross(normal, first)])


@kernel
def _circle(
    rate: float,
    phase: float,
    center: Array,
    radii: Array,
    position: Array,
    velocity: Array,
    acceleration: Array,
    t: float,
) -> None:
    cosine, sine = cos(rate * t + phase), sin(rate * t + phase)
    for i in range(center.size):
        radial = cosine * radii[0, i] + sine * radii[1, i]
        tangential = cosine * radii[1, i] - sine * radii[0, i]
        position[i] = center[i] + radial
        velocity[i] = rate * tangential
        acceleration[i] = -rate * rate * radial
