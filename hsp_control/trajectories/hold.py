"""A constant point, and a constant orientation."""

from functools import cached_property
from typing import ClassVar, Self

import numpy as np
import pinocchio as pin
from pydantic import InstanceOf

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Vector, numbers
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.engine.plans import TIME, PartCall, PartCalls
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample


class Hold(Trajectory, type="hold"):
    """x(t) = x0, a constant point."""

    constant: ClassVar[bool] = True
    points: ClassVar[tuple[str, ...]] = ("point",)

    point: Vector | None = None
    """x0, shape (n,) [m, or the task's unit]; where the robot starts by default."""

    @classmethod
    def of_value(cls, value: object) -> Self | None:
        """Return the point of n numbers; see `Declared.of_value`."""
        point = numbers(value)
        return None if point is None or point.ndim != 1 else cls(point)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return np.size(self.point) if self.point is not None else 0

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x0 and zero rates; see `Trajectory.sample`."""
        out = self._output(out)
        out.position[:] = np.asarray(self.point)
        out.velocity.fill(0.0)
        out.acceleration.fill(0.0)
        return out


class SetPoint(Trajectory):
    """x(t) that is written elsewhere at run time; without rates."""

    numbers: InstanceOf[np.ndarray]
    """x, shape (n,), read in every step [m, or the task's unit]."""

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self.numbers.size

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x and zero rates; see `Trajectory.sample`."""
        out = self._output(out)
        out.position[:] = self.numbers
        out.velocity.fill(0.0)
        out.acceleration.fill(0.0)
        return out

    def calls(self, out: TrajectorySample) -> PartCalls:
        """Return the call that writes x; see `Trajectory.calls`."""
        return [PartCall(engine.Copy, x=self.numbers, out=out.position, t=TIME)]


class HoldOrientation(OrientationTrajectory, type="hold"):
    """R(t) = R0, a constant orientation."""

    constant: ClassVar[bool] = True

    rotation: Rotation | None = None
    """R0, body to world: roll, pitch and yaw [rad], a quaternion or a matrix [-]; the
    orientation in which the robot starts by default."""

    @classmethod
    def of_value(cls, value: object) -> Self | None:
        """Return the orientation of a quaternion, a matrix, or roll, pitch and yaw."""
        if isinstance(value, pin.Quaternion):
            return cls(value)
        given = numbers(value)
        return None if given is None else cls(given)

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R0 and zero rates; see `OrientationTrajectory.sample`."""
        out = self._output(out)
        out.rotation[:] = self._matrix
        out.angular_velocity.fill(0.0)
        out.angular_acceleration.fill(0.0)
        return out

    @cached_property
    def _matrix(self) -> Array:
        assert self.rotation is not None
        return matrix_of(self.rotation)
