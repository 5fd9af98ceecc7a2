"""The tools in force: where frames are in the joints that carry them.

A frame that moves in its joint has a velocity and an acceleration beyond J v and
J v' + J' v; the tasks take them into account, so that each error obeys its equation
while a tool is exchanged, and no effort jumps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import LocalMotion
from hsp_control.trajectories import PoseTrajectory
from hsp_control.trajectories.pose import PoseSample


@dataclass(frozen=True)
class PlannedTool:
    """Where a frame is in its link, as a function of time."""

    frame: str
    placement: PoseTrajectory  # in the axes of the frame as the model has it


class ToolsInForce:
    """Lets the frames of a state be where the tools are now."""

    def __init__(self, state: RobotState) -> None:
        self._state, self._model = state, state.robot.model
        self._tools: Sequence[PlannedTool] = ()

    def plan(self, tools: Sequence[PlannedTool], t: float) -> None:
        """Follow other changes from now on; t is the present time [s]."""
        there = {each.frame for each in tools}
        for each in self._tools:
            if each.frame not in there:
                placement = _placement(self._model, each.frame)
                self._state.move_frame(each.frame, LocalMotion.fixed(placement))
        self._tools = tools
        self.write(t)

    def write(self, t: float) -> None:
        """Let the frames be where they are at a time [s], and move as they do then."""
        for each in self._tools:
            own = _placement(self._model, each.frame)
            motion = _motion(own.rotation, own.translation, each.placement.sample(t))
            self._state.move_frame(each.frame, motion)


def _motion(R: Array, p: Array, placement: PoseSample) -> LocalMotion:
    """Return the motion in its joint of a frame that the model places at (R, p)."""
    at, turned = placement
    return LocalMotion(
        R @ turned.rotation,
        p + R @ at.position,
        R @ at.velocity,
        R @ at.acceleration,
        R @ turned.angular_velocity,
        R @ turned.angular_acceleration,
    )


def _placement(model: pin.Model, frame: str) -> pin.SE3:
    return model.frames[model.getFrameId(frame)].placement
