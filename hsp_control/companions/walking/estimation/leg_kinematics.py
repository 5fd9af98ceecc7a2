"""Positions of contact points by the joints, relative to a frame of the robot."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.contacts import BallContact, Contact
from hsp_control.robot import Robot, RobotState


class Seen(NamedTuple):
    """Points of one contact, relative to a frame and in its axes.

    Attributes:
        points: Their positions, shape (k, 3) [m].
        jacobian: Their Jacobian, shape (3 k, nv).
        turning: Angular velocity of the contact's frame in the first frame, for joints
            that move, shape (3,) [rad/s].
    """

    points: Array
    jacobian: Array
    turning: Array


class LegKinematics:
    """Computes the kinematics of the joints, with the root of the robot at rest.

    Attributes:
        frame: The frame of reference.
        contacts: The contacts.
    """

    def __init__(self, robot: Robot, frame: str, contacts: Sequence[Contact]) -> None:
        """Set the frame and the contacts."""
        self.frame, self.contacts = frame, tuple(contacts)
        self._state = RobotState(robot)
        self._root = robot.joints[robot.joint_names[0]]
        self._rest: Array = robot.neutral()

    def update(self, q: Array, v: Array) -> None:
        """Update to the joints of a configuration (nq,) and of a velocity (nv,)."""
        root, joints, speeds = self._root, q.copy(), v.copy()
        joints[: root.nq] = self._rest[: root.nq]
        speeds[: root.nv] = 0.0
        self._state.update(0.0, joints, speeds)

    @property
    def unit(self) -> tuple[Array, Array, Array]:
        """The frame in the root: rotation (3, 3), position (3,), twist of it (6,)."""
        frame = self._state.frame(self.frame)
        return frame.rotation, frame.position, frame.velocity

    def seen(self, contact: Contact) -> Seen:
        """Return the points of a contact."""
        unit, foot = self._state.frame(self.frame), self._state.frame(contact.frame)
        arms = contact.points @ foot.rotation.T
        away = foot.position + arms - unit.position
        rows = []
        for arm, offset in zip(arms, away, strict=True):
            rows.append(
                foot.jacobian[:3]
                - unit.jacobian[:3]
                - np.cross(arm, foot.jacobian[3:], axis=0)
                + np.cross(offset, unit.jacobian[3:], axis=0)
            )
        R = unit.rotation
        jacobian = np.vstack([R.T @ row for row in rows])
        jacobian[:, : self._root.nv] = 0.0  # a motion of the root moves both
        turning = R.T @ (foot.velocity[3:] - unit.velocity[3:])
        return Seen(away @ R, jacobian, turning)


def rolled(contact: Contact, angular_velocity: Array, h: float) -> Array:
    """Return the displacement of a contact's points by rolling in a period, (3,) [m].

    The centre of a ball of radius r moves with ω × r n; other contacts do not roll.
    """
    if not isinstance(contact, BallContact):
        return np.zeros(3)
    return np.cross(angular_velocity, h * contact.radius * contact.axes[:, 2])
