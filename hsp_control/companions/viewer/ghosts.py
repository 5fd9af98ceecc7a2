"""Ghosts of the robot in other configurations: the page clones the drawn robot."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.companions.viewer.commands import (
    PLAY,
    PageCommand,
    page_command,
    path_element,
    typed_array,
)
from hsp_control.robot import Robot


class Ghosts:
    """Copies of a robot in a page, as many as there are configurations."""

    def __init__(self, name: str, robot: Robot, color: str, opacity: float) -> None:
        """Draw no ghost yet; ``name`` distinguishes these ghosts."""
        self._robot, self._data = robot, robot.model.createData()
        self._joints = [path_element(each) for each in robot.model.names[1:]]
        self._name = name
        self._look = {"color": color, "opacity": opacity}

    def show(self, configurations: Sequence[Array], text: str = "") -> PageCommand:
        """Return the command that shows ghosts, from q of shape (nq,), and a label."""
        poses = [self._poses(q) for q in configurations]
        return page_command(
            "ghosts",
            PLAY,
            f"ghosts {self._name}",
            ghosts=self._name,
            joints=self._joints,
            count=len(poses),
            poses=typed_array(np.array(poses), np.float32),
            text=text,
            **self._look,
        )

    def _poses(self, q: Array) -> Array:
        """Return the joints' poses, x, y, z and a quaternion, shape (joints, 7)."""
        pin.forwardKinematics(self._robot.model, self._data, q)
        return np.array([pin.SE3ToXYZQUAT(each) for each in self._data.oMi[1:]])
