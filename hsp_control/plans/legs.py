"""What a plan asks of a robot: its trunk, and how far its legs reach."""

import numpy as np
import pinocchio as pin

from hsp_control.common.exceptions import PlanError
from hsp_control.robot import Robot, RobotState


def root_frame(robot: Robot) -> str:
    """Return the body that the free-flyer root moves.

    Raises:
        PlanError: If there is none.
    """
    for frame in robot.model.frames:
        if frame.parentJoint == 1 and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    raise PlanError(f"{robot.name} has no body at its root")


def joints_of_leg(robot: Robot, foot: str) -> int:
    """Return how many freedoms of joints are between the root and a foot.

    Args:
        robot: The robot.
        foot: The frame of the foot.
    """
    model = robot.model
    joints = list(model.supports[model.frames[robot.frame_id(foot)].parentJoint])[2:]
    return sum(int(model.joints[joint].nv) for joint in joints)


def leg_length(robot: Robot, foot: str) -> float:
    """Return how far a foot can be from the first joint of its leg [m].

    The sum of the distances from joint to joint: no leg reaches farther.

    Args:
        robot: The robot.
        foot: The frame of the foot.
    """
    model = robot.model
    frame = model.frames[robot.frame_id(foot)]
    length = float(np.linalg.norm(frame.placement.translation))
    for joint in list(model.supports[frame.parentJoint])[3:]:
        length += float(np.linalg.norm(model.jointPlacements[joint].translation))
    return length


def hip_height(state: RobotState, foot: str) -> float:
    """Return the height of the first joint of a leg above its foot [m].

    Args:
        state: The state.
        foot: The frame of the foot.
    """
    model = state.robot.model
    joint = list(model.supports[model.frames[state.robot.frame_id(foot)].parentJoint])
    hip = state.data.oMi[joint[2]].translation[2]
    return float(hip - state.position(foot)[2])
