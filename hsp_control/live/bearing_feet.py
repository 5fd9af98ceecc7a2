"""Which contacts bear a robot with a floating base, and whether it falls."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FallError
from hsp_control.constraints.contacts import Contact
from hsp_control.control.falling import FallDetector
from hsp_control.control.measurement import Measurement
from hsp_control.robot import Robot, RobotState

_STEEPEST = 0.5
"""Smallest upward part of the normal of what carries weight [-]: a plane of 60°.
Steeper ones, such as a wall, may only be pushed: the joints that are held do it."""
_SMALLEST = 1e-6
"""Singular values below this share of the largest are directions that feet cannot push
in, such as the turning about the line between two points."""


class BearingFeet:
    """The contacts that bear, and the efforts that they let the joints deliver.

    A generalized force x, shape (nv,), is the sum of what joints and feet exert,
    x = Sᵀ tau + Jᵀ f. Its rows without motors determine the forces f at the feet's
    points, of minimum norm; then tau = S (x - Jᵀ f). While the feet stand still,
    J v = 0, these efforts do the work of x: vᵀ Sᵀ tau = vᵀ x.

    Without motors in six rows, and without a foot that bears, nothing holds the robot.
    """

    def __init__(self, robot: Robot, contacts: Sequence[Contact]) -> None:
        self._robot = robot
        self._all = tuple(c for c in contacts if c.axes[2, 2] >= _STEEPEST)
        self._base = list(robot.unactuated)
        self.contacts = self._all  # the contacts that bear now

    @property
    def hold(self) -> bool:
        """Whether the robot can be held: by its base, or by a foot that bears."""
        return not self._base or bool(self.contacts)

    def feel(self, measured: Measurement) -> None:
        """Find which contacts bear: those that are pressed."""
        if self._base:
            self.contacts = tuple(
                each for each in self._all if _bears(each, measured)
            )  # fmt: skip

    def lose(self) -> None:
        """Let no contact bear any more."""
        self.contacts = ()

    def joint_effort(self, state: RobotState, force: Array) -> Array:
        """Return the efforts (nv,) that exert x (nv,) with the feet's help."""
        if not self._base:
            return force
        effort = force.copy()
        if self.contacts:
            J = np.vstack([_points_jacobian(each, state) for each in self.contacts])
            inverse = np.linalg.pinv(J[:, self._base].T, rcond=_SMALLEST)
            effort -= J.T @ (inverse @ force[self._base])
        effort[self._base] = 0.0
        return effort


def _bears(contact: Contact, measured: Measurement) -> bool:
    force = measured.normal_force(contact.frame, contact.axes[:, 2])
    return contact.active(measured.t) if force is None else force > 0.0


def _points_jacobian(contact: Contact, state: RobotState) -> Array:
    """Return the Jacobian of a contact's points, shape (3 k, nv)."""
    frame = state.frame(contact.frame)
    linear, angular = frame.jacobian[:3], frame.jacobian[3:]
    rows = [linear - np.cross(arm, angular, axis=0) for arm in contact.arms(frame)]
    return np.vstack(rows)


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
