"""The task of a frame's pose relative to another frame, as for two hands on a part."""

from dataclasses import KW_ONLY, replace
from typing import Self

import pinocchio as pin

from hsp_control import engine
from hsp_control.common.errors import TaskError
from hsp_control.declaration import within
from hsp_control.declaration.given import default
from hsp_control.engine.plans import CallOutput, PartCall
from hsp_control.geometry.scene import Start
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameMotion
from hsp_control.tasks.frame_pose import PoseOrPoint, PoseTask
from hsp_control.tasks.frame_task import frame_of, place_pose
from hsp_control.tasks.task import default_name
from hsp_control.trajectories import ComposedPose


class RelativePose(PoseTask, type="relative_pose"):
    """e = (x_d - x, -log(R_dᵀ Q)), x = R_rᵀ(p - p_r), Q = R_rᵀ R [m, rad].

    The pose of a frame relative to a reference frame r, in the axes of r. Both errors
    are exactly linear; everything else is as in `FramePose`.
    """

    frame: str | None = None
    """Name of the frame that is controlled [-]; the robot's end effector by default."""
    trajectory: PoseOrPoint = default(ComposedPose())
    """The desired pose, reference ← frame, or the trajectory of its origin, with the
    relative orientation of the start [m, rad]; held at the start by default."""
    _: KW_ONLY
    reference: str
    """Name of the frame of reference [-]."""

    def _default_name(self) -> str:
        return default_name(f"{self.frame or 'end_effector'}_from_{self.reference}")

    @property
    def frame_name(self) -> str:
        """Name of the frame of a placed task."""
        if self.frame is None:
            raise self._not_placed("frame")
        return self.frame

    def placed(self, start: Start) -> Self:
        """Return the task with its trajectory in the reference; see `Task.placed`."""
        robot: Robot = start.state.robot
        frame = frame_of(self.frame, robot)
        with within("reference"):
            robot.frame_id(self.reference)
            if frame == self.reference:
                raise TaskError(
                    f"frame and reference are both {frame!r}; they must be different "
                    "frames"
                )
        poses = [start.state.frame(name) for name in (self.reference, frame)]
        there, here = (pin.SE3(pose.rotation, pose.position) for pose in poses)
        trajectory = place_pose(self.trajectory, there.actInv(here), self.blend)
        placed = replace(self, frame=frame, trajectory=trajectory, blend=None)
        return placed.checked(robot)

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Task.call`."""
        kinematics = PartCall(
            engine.RelativeKinematics,
            frame=state.frame(self.frame_name),
            reference=state.frame(self.reference),
        )
        relative = CallOutput(kinematics, FrameMotion.allocate(state.robot.nv))
        return PartCall(
            engine.TrackPose, frame=relative, desired=self.followed, turning=False
        )

    def moving(self, state: RobotState) -> FrameMotion:
        """Return the motion of the frame in the reference."""
        frame, reference = state.frame(self.frame_name), state.frame(self.reference)
        relative = FrameMotion.allocate(state.robot.nv)
        engine.RelativeKinematics(
            frame=frame.motion, reference=reference.motion, out=relative
        )()
        return relative
