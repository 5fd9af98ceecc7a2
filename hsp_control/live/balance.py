"""Whether a robot with a floating base falls, in a live loop with or without a plan."""

from collections.abc import Sequence

import pinocchio as pin

from hsp_control.common.exceptions import FallError
from hsp_control.constraints.contacts import Contact
from hsp_control.control.falling import FallDetector
from hsp_control.robot import Robot, RobotState

_ROOT = 1
"""Index of the joint that a floating base is."""


class Balance:
    """Compares tilt and height with those of the start; see `FallDetector`."""

    def __init__(self, detector: FallDetector) -> None:
        self._detector = detector
        self.lost = False  # whether the robot has fallen

    def fault(self, state: RobotState) -> str | None:
        """Return why the robot is falling, or None."""
        try:
            self._detector.check(state)
        except FallError as error:
            return str(error)
        return None


def balance_of(
    robot: Robot, contacts: Sequence[Contact], state: RobotState
) -> Balance | None:
    """Return what watches a robot's balance; None if its base is fixed."""
    if not robot.unactuated:
        return None
    base = next(
        str(frame.name)
        for frame in robot.model.frames
        if frame.parentJoint == _ROOT and frame.type == pin.FrameType.BODY
    )
    feet = tuple(contact.frame for contact in contacts)
    return Balance(FallDetector(base, feet, state))
