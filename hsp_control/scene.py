"""What stands or moves in the robot's world."""

from collections.abc import Iterable, Iterator, Mapping

from hsp_control.exceptions import SceneError
from hsp_control.suggest import did_you_mean, listing
from hsp_control.trajectories import Trajectory


class Obstacle:
    """A ball (in the plane: a disk) whose centre follows a trajectory.

    Attributes:
        name: What fields and the log call it.
        center: Its centre in the world [m], of dimension 3.
        radius: Its radius [m].
    """

    def __init__(self, name: str, center: Trajectory, radius: float) -> None:
        """Set the obstacle.

        Raises:
            SceneError: If the centre is not a point in space or the radius negative.
        """
        if center.dimension != 3:
            raise SceneError(
                f"obstacle {name!r}: its centre has dimension {center.dimension}; "
                "needs 3 (x, y, z)"
            )
        if not 0.0 <= radius < float("inf"):
            raise SceneError(f"obstacle {name!r}: radius {radius} must be at least 0")
        self.name = name
        self.center = center
        self.radius = float(radius)


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
