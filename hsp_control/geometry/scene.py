"""What stands or moves in the robot's world."""

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
    """A shape that stands or moves along trajectories.

    Attributes:
        name: What fields and the log call it.
        shape: Its form, centred on its own frame.
        center: Where its frame's origin is in the world [m], of dimension 3.
        orientation: How its frame is turned in the world.
    """

    def __init__(
        self,
        name: str,
        shape: Shape,
        center: Trajectory,
        orientation: OrientationTrajectory | None = None,
    ) -> None:
        """Set the obstacle; without an orientation it stands along the world's axes.

        Raises:
            SceneError: If the centre is not a point in space.
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
        """Return a function of time [s] that keeps an array at the obstacle's motion.

        See `Trajectory.follow`.

        Args:
            motion: R row by row, c, c' and ω, shape (18,).
        """
        center = TrajectorySample(motion[9:12], motion[12:15], np.zeros(3))
        turn = OrientationSample(motion[:9].reshape(3, 3), motion[15:18], np.zeros(3))
        return follow_all(self.center.follow(center), self.orientation.follow(turn))


class Scene(Mapping[str, Obstacle]):
    """The obstacles by name."""

    def __init__(self, obstacles: Iterable[Obstacle] = ()) -> None:
        """Collect obstacles.

        Raises:
            SceneError: If two have the same name.
        """
        self._obstacles: dict[str, Obstacle] = {}
        for obstacle in obstacles:
            if obstacle.name in self._obstacles:
                raise SceneError(f"two obstacles are called {obstacle.name!r}")
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
