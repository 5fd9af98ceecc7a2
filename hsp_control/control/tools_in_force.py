"""The tools in force: placements of frames in the joints that carry them.

A frame that moves in its joint has a velocity and an acceleration beyond J v and
J v' + J' v; the tasks take them into account, so that each error obeys its equation
while a tool is exchanged, and no effort jumps.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.engine import Plan
from hsp_control.engine.plans import PartCall, Step, planned
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import LocalMotion
from hsp_control.trajectories import PoseTrajectory


@dataclass(frozen=True)
class PlannedTool:
    """The placement of a frame in its link, as a function of time."""

    frame: str
    placement: PoseTrajectory  # in the axes of the frame as the model has it


class ToolsInForce:
    """Moves the frames of a state to the present tools."""

    def __init__(self, state: RobotState) -> None:
        self._state, self._model = state, state.robot.model
        self._tools: Sequence[PlannedTool] = ()
        # those that write the motions of all tools at a time [s]
        self.steps: list[Step] = []

    def plan(self, tools: Sequence[PlannedTool], t: float) -> None:
        """Follow other changes from now on; t is the present time [s]."""
        there = {each.frame for each in tools}
        for each in self._tools:
            if each.frame not in there:
                placement = _placement(self._model, each.frame)
                self._state.move_frame(each.frame, LocalMotion.fixed(placement))
        if [*map(id, tools)] != [*map(id, self._tools)]:
            self._tools = tools
            self.steps = self._bound()
        self.write(t)

    def write(self, t: float) -> None:
        """Set the frames' placements and motions to those of a time [s]."""
        Plan(self.steps)(t)
        self.forget()

    def forget(self) -> None:
        """Have the frames computed anew at the same state."""
        for each in self._tools:
            self._state.forget_frame(each.frame)

    def _bound(self) -> list[Step]:
        calls = []
        for each in self._tools:
            own = _placement(self._model, each.frame)
            call = PartCall(
                engine.ToolInJoint,
                rotation=np.ascontiguousarray(own.rotation),
                position=own.translation.copy(),
                pose=each.placement,
                out=self._state.local_motion(each.frame),
            )
            calls.append(call)
        return planned(calls).steps()


def _placement(model: pin.Model, frame: str) -> pin.SE3:
    return model.frames[model.getFrameId(frame)].placement
