"""The abstract trajectory of an orientation in SO(3)."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError
from hsp_control.declaration import Part
from hsp_control.trajectories.following import Follower, follow_by


class OrientationSample(NamedTuple):
    """R(t), ω(t) and ω'(t): an orientation trajectory at one time."""

    rotation: Array
    """R(t), body to world, shape (3, 3)."""
    angular_velocity: Array
    """ω(t) in the world frame, R' = [ω]× R, shape (3,) [rad/s]."""
    angular_acceleration: Array
    """ω'(t) in the world frame, shape (3,) [rad/s²]."""

    @classmethod
    def allocate(cls) -> "OrientationSample":
        """Return a sample at the identity, for `OrientationTrajectory.sample`."""
        return cls(np.eye(3), np.zeros(3), np.zeros(3))


class OrientationTrajectory(Part, ABC, family="orientations", error=TrajectoryError):
    """R(t) in SO(3) with ω(t) and ω'(t); a value, defined at every t.

    R is body to world, ω is in world axes. A subclass declares its parameters as fields
    and implements `sample`; it may override `follow`, or derive from `Compiled`, as
    described in `Trajectory`. A motion of finite duration rests at its first
    orientation before the start and at its last orientation after the end.

    A field `rotation` that is omitted means the orientation in which the robot starts.
    Such a trajectory cannot be sampled; `anchored` returns it with that orientation.
    """

    @property
    def relative(self) -> bool:
        """Whether it depends on where the robot starts."""
        return getattr(self, "rotation", self) is None

    def anchored(self, start: ArrayLike) -> Self:
        """Return this trajectory for a robot that starts in an orientation.

        Args:
            start: The orientation, body to world; a matrix of shape (3, 3), or as in
                `Rotation`.
        """
        if not self.relative:
            return self
        rotated: dict[str, Any] = {"rotation": start}
        return replace(self, **rotated)

    @abstractmethod
    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R(t), ω(t) and ω'(t), shapes (3, 3), (3,) and (3,).

        Args:
            t: Time [s].
            out: The sample to write into; None: a new one, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.
        """

    def follow(self, out: OrientationSample) -> Follower:
        """Return a call that writes ``out`` for a time [s]; see `Trajectory.follow`."""
        return follow_by(self.sample, out)

    def _output(self, out: OrientationSample | None) -> OrientationSample:
        """Return ``out``, or a new sample if it is None."""
        if self.relative:
            raise TrajectoryError(
                f"{type(self).__name__} has no rotation: it is that in which the robot "
                "starts, which only a controller knows; give rotation, or `anchored`"
            )
        return OrientationSample.allocate() if out is None else out
