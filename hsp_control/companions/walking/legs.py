"""A plan's requirements of a robot: its trunk, and the reach of its legs."""

import numpy as np
import pinocchio as pin

from hsp_control.common.errors import PlanError
from hsp_control.robot import Robot, RobotState


def root_frame(robot: Robot) -> str:
    """Return the body that the free-flyer root moves."""
    for frame in robot.model.frames:
        if frame.parentJoint == 1 and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    raise PlanError(f"{robot.name} has no link at its root")


def leg_joints(robot: Robot, foot: str) -> list[int]:
    """Return the joints from the root to a foot, the root itself not among them."""
    model = robot.model
    joint = model.frames[robot.frame_id(foot)].parentJoint
    return [int(each) for each in list(model.supports[joint])[2:]]


def leg_freedoms(robot: Robot, foot: str) -> int:
    """Return the number of degrees of freedom from the root to a foot."""
    return sum(robot.model.joints[joint].nv for joint in leg_joints(robot, foot))


def leg_length(robot: Robot, foot: str) -> float:
    """Return the maximum distance of a foot from the first joint of its leg [m].

    The sum of the distances from joint to joint: no leg reaches farther.
    """
    model = robot.model
    frame = model.frames[robot.frame_id(foot)]
    length = float(np.linalg.norm(frame.placement.translation))
    for joint in leg_joints(robot, foot)[1:]:
        length += float(np.linalg.norm(model.jointPlacements[joint].translation))
    return length


def hip_height(state: RobotState, foot: str) -> float:
    """Return the height of the first joint of a leg above its foot [m]."""
    hip = state.data.oMi[leg_joints(state.robot, foot)[0]].translation[2]
    return float(hip - state.position(foot)[2])
