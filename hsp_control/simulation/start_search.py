"""The search for a start: which postures are good for the tasks of a configuration."""

from collections.abc import Iterable
from dataclasses import KW_ONLY

import pinocchio as pin

from hsp_control.common.exceptions import ConfigurationError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Name, Vector3
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.geometry.good_postures import PostureSearch, Rows
from hsp_control.geometry.scene import Scene
from hsp_control.robot import Robot
from hsp_control.robot.inverse_kinematics import Target
from hsp_control.tasks import FrameOrientation, FramePose, FramePosition, Task
from hsp_control.tasks.axes import axis_indices
from hsp_control.tasks.frame_task import frame_of


class StartPose(Part, error=ConfigurationError):
    """Where a frame shall be at the start; inverse kinematics finds the joints."""

    _: KW_ONLY
    frame: Name | None = None
    """Name of the frame; the robot's end effector by default."""
    position: Vector3
    """Its origin in the world [m]."""
    rotation: Rotation | None = None
    """Its orientation in the world: roll, pitch and yaw [rad], a quaternion
    (x, y, z, w) [-], or a matrix [-]; any by default."""

    def target(self, robot: Robot) -> Target:
        """Return what inverse kinematics tries to reach.

        Raises:
            FrameNotFoundError: If there is no such frame.
        """
        place = pin.SE3.Identity()
        place.translation = self.position
        if self.rotation is not None:
            place.rotation = matrix_of(self.rotation)
        rows = 3 if self.rotation is None else 6
        return Target(frame_of(self.frame, robot), place, rows)


def posture_search(
    robot: Robot, tasks: Iterable[Task] = (), scene: Scene | None = None
) -> PostureSearch:
    """Return the search for postures that are good for tasks and clear of a scene."""
    if robot.unactuated:
        raise ConfigurationError(
            f"{robot.name} has a free-flyer root; a start is found for robots with a "
            "fixed base only: give joints, and ground"
        )
    obstacles = () if scene is None else tuple(scene.values())
    return PostureSearch(robot, tracked_rows(tasks, robot), obstacles)


def tracked_rows(tasks: Iterable[Task], robot: Robot) -> list[Rows]:
    """Return what those tasks of the highest priority track that track frames."""
    tasks = list(tasks)
    first = min((task.priority or 1 for task in tasks), default=1)
    found = []
    for task in tasks:
        if (task.priority or 1) > first:
            continue
        match task:
            case FramePosition():
                rows = tuple(axis_indices(task.axes).tolist())
            case FrameOrientation():
                rows = (3, 4, 5)
            case FramePose():
                rows = (0, 1, 2, 3, 4, 5)
            case _:
                continue
        found.append((frame_of(task.frame, robot), rows))
    return found
