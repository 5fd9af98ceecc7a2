"""Curves in closed form: a circle, a Lissajous figure, an infinite line."""

from dataclasses import KW_ONLY
from fractions import Fraction
from functools import cached_property
from math import lcm
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError
from hsp_control.declaration.quantities import Matrix, Number, Positive, Vector, Vector3
from hsp_control.engine.plans import PartCall
from hsp_control.trajectories import checks
from hsp_control.trajectories.arc_length import Course
from hsp_control.trajectories.trajectory import Trajectory


class Circle(Trajectory, type="circle"):
    """x(t) = c + r (cos θ u1 + sin θ u2), θ = ω t + θ0, for all t.

    The paper's (1 + cos 3t, 1 + sin 3t) is ``Circle(1, 3, center=[1, 1])``. In the
    plane u1 and u2 are the x and y axes; in space the circle is level, unless
    ``normal`` or ``axes`` define others.
    """

    points: ClassVar[tuple[str, ...]] = ("center",)

    radius: Positive
    """r [m, or the task's unit]."""
    angular_rate: Number
    """ω [rad/s]."""
    center: Vector | None = None
    """c, shape (n,) [m, or the task's unit]; where the robot starts by default."""
    _: KW_ONLY
    phase: Number = 0.0
    """θ0, the angle at t = 0 [rad]."""
    normal: Vector3 | None = None
    """In space: normal of the circle's plane, of any length but zero [-]; for ω > 0 the
    motion is right-handed about it."""
    toward: Vector3 | None = None
    """With a normal: a direction whose projection onto the plane is u1 [-]; by default
    the coordinate axis that is most nearly perpendicular to the normal."""
    axes: Matrix | None = None
    """Instead of a normal: u1 and u2, orthonormal, shape (2, n) [-]."""

    def __post_init__(self) -> None:
        """Check the plane."""
        if self.normal is not None and self.axes is not None:
            raise TrajectoryError("give axes or a normal, not both")
        if self.toward is not None and self.normal is None:
            raise TrajectoryError("toward needs a normal; axes define it already")
        given = (self.center, self.normal, self.axes)
        if any(each is not None for each in given):  # otherwise n is not yet known
            self._plane  # noqa: B018 (computed, checked and kept)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        if self.center is not None:
            return np.size(self.center)
        return 3 if self.axes is None else np.shape(self.axes)[-1]

    @property
    def course(self) -> Course:
        """One turn, repeated."""
        return Course.turn(self.angular_rate)

    @cached_property
    def _plane(self) -> Array:
        """u1 and u2, shape (2, n)."""
        n = self.dimension
        if self.axes is not None:
            return checks.orthonormal(self.axes, "axes", (2, n))
        if self.normal is None and n == 2:
            return np.eye(2)
        if n != 3:
            needs = "axes" if self.normal is None else "dimension 3 for its normal"
            raise TrajectoryError(f"a circle in dimension {n} needs {needs}")
        normal = [0.0, 0.0, 1.0] if self.normal is None else self.normal
        return _axes_from_normal(checks.direction(normal, "normal"), self.toward)

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        radii = self.radius * self._plane
        center = np.asarray(self.center, dtype=float)
        return PartCall(
            engine.Circle,
            rate=self.angular_rate,
            phase=self.phase,
            center=center,
            radii=radii,
        )


def _axes_from_normal(normal: Array, toward: ArrayLike | None) -> Array:
    """Return u1 and u2 = normal × u1, shape (2, 3); ``normal`` has length 1."""
    if toward is None:
        first = np.eye(3)[np.argmin(np.abs(normal))]
    else:
        first = checks.direction(toward, "toward")
    first = first - (first @ normal) * normal
    length = float(np.linalg.norm(first))
    if length < 1e-6:
        raise TrajectoryError(
            "toward must not be parallel to normal; both have the direction "
            f"{normal.tolist()}"
        )
    first /= length
    return np.stack([first, np.cross(normal, first)])


class Lissajous(Trajectory, type="lissajous"):
    """x_i(t) = c_i + a_i sin(ω_i t + φ_i), for all t."""

    points: ClassVar[tuple[str, ...]] = ("center",)

    amplitudes: Vector
    """a, shape (n,) [m, or the task's unit]."""
    rates: Vector
    """ω, shape (n,) [rad/s]."""
    phases: Vector | None = None
    """φ at t = 0, shape (n,) [rad]; zero by default."""
    center: Vector | None = None
    """c, shape (n,) [m, or the task's unit]; where the robot starts by default."""

    def __post_init__(self) -> None:
        """Check that all have one shape."""
        shape = np.shape(self.amplitudes)
        checks.array(self.rates, "rates", shape)
        for name in ("phases", "center"):
            value = getattr(self, name)
            if value is not None:
                checks.array(value, name, shape)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return np.size(self.amplitudes)

    @property
    def course(self) -> Course | None:
        """One period, repeated, if the rates have a common one."""
        rates = np.asarray(self.rates)[np.asarray(self.rates) != 0.0]
        if not len(rates):
            return None
        ratios = [Fraction(rate / rates[0]).limit_denominator(1000) for rate in rates]
        if not np.allclose(rates, rates[0] * np.array(ratios, float), 1e-12, 0.0):
            return None
        return Course.turn(rates[0] / lcm(*(ratio.denominator for ratio in ratios)))

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        phases = np.zeros(self.dimension) if self.phases is None else self.phases
        return PartCall(
            engine.Lissajous,
            center=np.array(self.center, dtype=float),
            amplitudes=np.array(self.amplitudes, dtype=float),
            rates=np.array(self.rates, dtype=float),
            phases=np.array(phases, dtype=float),
        )


class UniformLine(Trajectory, type="uniform_line"):
    """x(t) = x0 + t v, for all t. For a line that starts and stops use `Line`."""

    points: ClassVar[tuple[str, ...]] = ("start",)

    velocity: Vector
    """v, shape (n,) [m/s, or the task's unit per s]."""
    start: Vector | None = None
    """x0, the point at t = 0, shape (n,) [m, or the task's unit]; where the robot
    starts by default."""

    def __post_init__(self) -> None:
        """Check that both have one shape."""
        if self.start is not None:
            checks.array(self.velocity, "velocity", np.shape(self.start))

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return np.size(self.velocity)

    @property
    def course(self) -> Course:
        """The line of one second, repeated."""
        return Course(np.array([0.0, 1.0]), True)

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        start, velocity = np.asarray(self.start), np.asarray(self.velocity)
        return PartCall(engine.UniformLine, start=start, velocity=velocity)
