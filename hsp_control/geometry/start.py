"""Where a controller starts."""

from typing import NamedTuple

from hsp_control.geometry.scene import Scene
from hsp_control.robot import RobotState


class Start(NamedTuple):
    """What parts are placed at: relative points and names of obstacles refer to it.

    Attributes:
        state: The robot's state at the start.
        scene: The obstacles.
        known: Whether the robot really starts there; if not, the state only serves to
            check the parts.
    """

    state: RobotState
    scene: Scene
    known: bool = True
