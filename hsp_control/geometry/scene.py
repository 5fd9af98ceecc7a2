"""Obstacles in the robot's world, fixed or moving, and the robot's start there."""

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SceneError, TrajectoryError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration import Part
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.nested import BY_NAME, parts_within, stored
from hsp_control.declaration.quantities import ArrayField, Name
from hsp_control.declaration.rotation import AnyRotation
from hsp_control.engine.plans import PartCalls
from hsp_control.geometry.shapes import Shape
from hsp_control.robot import RobotState
from hsp_control.trajectories import (
    HoldOrientation,
    OrientationSample,
    OrientationTrajectory,
    Trajectory,
    TrajectorySample,
)
from hsp_control.trajectories.streams.streamed import Streamed


def _in_space(center: Trajectory) -> Trajectory:
    """Return the trajectory of a point in the world."""
    _refuse_declared_streams(center)
    try:
        center = center.anchored(None)
    except TrajectoryError as error:
        raise SceneError(str(error)) from None
    if center.dimension != 3:
        raise SceneError(f"its dimension is {center.dimension}; needs 3 (x, y, z)")
    return center


def _refuse_declared_streams(trajectory: Part) -> None:
    if any(True for _ in parts_within(trajectory, Streamed)):
        raise SceneError(
            "a stream cannot move an obstacle from the start; while the controller "
            "runs, controller.at(t).obstacle(name, stream) does"
        )


def _from_world_axes(orientation: OrientationTrajectory) -> OrientationTrajectory:
    _refuse_declared_streams(orientation)
    return orientation.anchored(np.eye(3))


class Obstacle(Part, error=SceneError):
    """A shape that is fixed, or moves along trajectories; a value."""

    yaml_key: ClassVar[str | None] = "name"

    name: Name
    """Its name in fields and in the log [-]; in YAML, its key in the scene."""
    shape: Shape
    """Its shape, centred on its own frame [-]."""
    center: Given[Annotated[Trajectory, AfterValidator(_in_space)], ArrayLike]
    """Trajectory of its frame's origin in the world, of dimension 3 [m]."""
    orientation: Given[
        Annotated[OrientationTrajectory, AfterValidator(_from_world_axes)], AnyRotation
    ] = default(HoldOrientation((0.0, 0.0, 0.0)))
    """Trajectory of its frame's orientation, body to world [-]; along the world's axes
    by default. One without a rotation begins along them."""

    def placement(self, t: float) -> pin.SE3:
        """Return its placement in the world at time t [s]."""
        rotation = self.orientation.sample(t).rotation
        return pin.SE3(rotation, self.center.sample(t).position)

    def calls(self, motion: Array) -> PartCalls:
        """Return the calls that write R by rows, c, c' and ω (18,) at a time."""
        center = TrajectorySample(motion[9:12], motion[12:15], np.zeros(3))
        turn = OrientationSample(motion[:9].reshape(3, 3), motion[15:18], np.zeros(3))
        return [*self.center.calls(center), *self.orientation.calls(turn)]


class Scene(Part, Mapping[str, Obstacle], error=SceneError):
    """The obstacles of a world, a mapping by name; a value.

    In YAML, ``obstacles`` is a mapping too, and its keys are their names.
    """

    obstacles: Annotated[
        Iterable[Obstacle],
        ArrayField(Annotated[dict[Name, Obstacle], Field(max_length=1000)], stored),
        BY_NAME,
    ] = ()
    """The obstacles, in the order of the log [-]; no two have the same name."""

    @cached_property
    def _by_name(self) -> dict[str, Obstacle]:
        return {obstacle.name: obstacle for obstacle in self.obstacles}

    def __getitem__(self, name: str) -> Obstacle:
        try:
            return self._by_name[name]
        except (KeyError, TypeError):  # also objects that are no names, such as a list
            known = listing(self) or "none"
            raise SceneError(
                f"no obstacle {name!r}{did_you_mean(name, self)} "
                f"(the scene has {known})"
            ) from None

    def __contains__(self, name: object) -> bool:
        return name in self._by_name

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)


class Start(NamedTuple):
    """The start at which parts are placed: relative points and obstacles refer to it.

    Attributes:
        state: The robot's state at the start.
        scene: The obstacles.
        known: Whether the robot really starts there; if not, the state only serves to
            check the parts.
    """

    state: RobotState
    scene: Scene
    known: bool = True
