"""The abstract trajectory of a pose in SE(3), and one composed of two trajectories."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError
from hsp_control.trajectories.following import Follower, follow_all, follow_by
from hsp_control.trajectories.immutable import Immutable
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample


class PoseSample(NamedTuple):
    """x, x', x'', R, ω and ω': a pose trajectory at one time, in world axes."""

    position: TrajectorySample
    """The body's origin, of dimension 3 [m, m/s, m/s²]."""
    orientation: OrientationSample
    """Its rotation, angular velocity and angular acceleration."""

    @classmethod
    def allocate(cls) -> "PoseSample":
        """Return a sample at the identity and at rest, for `PoseTrajectory.sample`."""
        memory = np.zeros((8, 3))
        memory[3, 0] = memory[4, 1] = memory[5, 2] = 1.0
        return cls.over(memory)

    @classmethod
    def over(cls, memory: Array) -> "PoseSample":
        """Return a sample whose arrays are views of ``memory``.

        Args:
            memory: Shape (8, 3); its rows are x, x', x'', R (three rows), ω, ω'.
        """
        return cls(
            TrajectorySample(memory[0], memory[1], memory[2]),
            OrientationSample(memory[3:6], memory[6], memory[7]),
        )


class PoseTrajectory(Immutable, ABC):
    """M(t) = (R(t), x(t)) in SE(3); immutable, stateless, defined at every t.

    Body to world; x is the body's origin [m], all rates are in world axes. A subclass
    assigns its parameters in ``__init__``, lists them in ``__slots__`` and implements
    `sample`; it may override `follow`, see `Trajectory.follow`.
    """

    __slots__ = ()

    @abstractmethod
    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t with its first two derivatives.

        Args:
            t: Time [s].
            out: The sample to write into; None: a new one, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.
        """

    def follow(self, out: PoseSample) -> Follower:
        """Return a function of time [s] that writes the sample into ``out``.

        See `Trajectory.follow`.
        """

        def sampler(t: float, own: tuple[Array, ...]) -> tuple[Array, ...]:
            sample = self.sample(t, out)
            return own if sample is out else (*sample.position, *sample.orientation)

        return follow_by(sampler, (*out.position, *out.orientation))


class ComposedPose(PoseTrajectory):
    """M(t) = (R(t), x(t)), with x and R given by one trajectory each.

    Attributes:
        position: The origin's trajectory, of dimension 3 [m].
        orientation: The orientation's trajectory.
    """

    __slots__ = ("orientation", "position")

    def __init__(
        self, position: Trajectory, orientation: OrientationTrajectory
    ) -> None:
        """Compose a pose of a position and an orientation.

        Args:
            position: x(t), of dimension 3 [m].
            orientation: R(t), body to world.

        Raises:
            TrajectoryError: If ``position`` does not have dimension 3.
        """
        if position.dimension != 3:
            raise TrajectoryError(
                f"position has dimension {position.dimension}; "
                "the origin of a pose needs dimension 3"
            )
        self.position = position
        self.orientation = orientation

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        if out is None:
            out = PoseSample.allocate()
        self.position.sample(t, out.position)
        self.orientation.sample(t, out.orientation)
        return out

    def follow(self, out: PoseSample) -> Follower:
        """Return a function of time that updates ``out``; see `Trajectory.follow`."""
        return follow_all(
            self.position.follow(out.position),
            self.orientation.follow(out.orientation),
        )
