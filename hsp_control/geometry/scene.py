"""Obstacles in the robot's world, fixed or moving."""

from collections.abc import Iterable, Iterator, Mapping

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SceneError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.geometry.shapes import Shape
from hsp_control.trajectories import (
    HoldOrientation,
    OrientationSample,
    OrientationTrajectory,
    Trajectory,
    TrajectorySample,
)
from hsp_control.trajectories.following import Follower, follow_all


class Obstacle:
    """A shape that is fixed, or moves along trajectories.

    Attributes:
        name: Its name in fields and in the log.
        shape: Its shape, centred on its own frame.
        center: Trajectory of its frame's origin in the world [m], of dimension 3.
        orientation: Trajectory of its frame's orientation in the world.
    """

    def __init__(
        self,
        name: str,
        shape: Shape,
        center: Trajectory,
        orientation: OrientationTrajectory | None = None,
    ) -> None:
        """Set the obstacle; the default orientation is that of the world's axes.

        Raises:
            SceneError: If the dimension of the centre is not 3.
        """
        if center.dimension != 3:
            raise SceneError(
                f"obstacle {name!r}: its centre has dimension {center.dimension}; "
                "needs 3 (x, y, z)"
            )
        self.name = name
        self.shape = shape
        self.center = center
        self.orientation = orientation or HoldOrientation(np.eye(3))

    def placement(self, t: float) -> pin.SE3:
        """Return its placement in the world at time t [s]."""
        rotation = self.orientation.sample(t).rotation
        return pin.SE3(rotation, self.center.sample(t).position)

    def follow(self, motion: Array) -> Follower:
        """Return a function of time [s] that writes the obstacle's motion to an array.

        See `Trajectory.follow`.

        Args:
            motion: Is overwritten with R row by row, the centre c [m], c' [m/s] and the
                angular velocity ω [rad/s] in the world, shape (18,).
        """
        center = TrajectorySample(motion[9:12], motion[12:15], np.zeros(3))
        turn = OrientationSample(motion[:9].reshape(3, 3), motion[15:18], np.zeros(3))
        return follow_all(self.center.follow(center), self.orientation.follow(turn))


class Scene(Mapping[str, Obstacle]):
    """The obstacles of a world, by name."""

    def __init__(self, obstacles: Iterable[Obstacle] = ()) -> None:
        """Collect obstacles.

        Raises:
            SceneError: If two have the same name.
        """
        self._obstacles: dict[str, Obstacle] = {}
        for obstacle in obstacles:
            if obstacle.name in self._obstacles:
                raise SceneError(f"two obstacles have the name {obstacle.name!r}")
            self._obstacles[obstacle.name] = obstacle

    def __getitem__(self, name: str) -> Obstacle:
        try:
            return self._obstacles[name]
        except KeyError:
            known = listing(self._obstacles) or "none"
            raise SceneError(
                f"no obstacle {name!r}{did_you_mean(name, self._obstacles)} "
                f"(the scene has {known})"
            ) from None

    def __contains__(self, name: object) -> bool:
        return name in self._obstacles

    def __iter__(self) -> Iterator[str]:
        return iter(self._obstacles)

    def __len__(self) -> int:
        return len(self._obstacles)
