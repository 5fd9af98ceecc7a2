"""The commanded forces of contacts: the reference of the forces at their points."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.contacts import Contact, SlidingContact
from hsp_control.constraints.contacts.commanded_force import NORMAL, WRENCH, shares
from hsp_control.control.planned_contact import PlannedContact
from hsp_control.law import Resolution
from hsp_control.robot import RobotState
from hsp_control.trajectories import TrajectorySample

COMMANDED_INVERSE_COST = 1e-6
"""ε: how much cheaper it is, per squared force, to change a free force than a commanded
one. Feet that carry 1 kN then leave a commanded force 1 mN from its command. In a
limited step it makes a miss of the command dearer than motion of the null space, and
cheaper than a miss of the tasks."""


class CommandedForces:
    """Writes f_ref for the points of one contact, and how dear other forces are."""

    def __init__(self, planned: PlannedContact) -> None:
        """Follow the command of a contact."""
        contact = planned.contact
        assert contact.force is not None
        self._contact, self._offset = contact, planned.force_offset
        n = contact.force.dimension
        self._command = TrajectorySample.allocate(n)
        self._follow = contact.force.followed.follow(self._command)
        k = len(contact.points)
        self._varies = n == WRENCH  # with the arms
        self._shares = np.zeros((3 * k, n))
        if not self._varies:
            self._shares[:] = shares(n, np.zeros((k, 3)))
        only_normal = n == NORMAL and not contact.slides
        # commanded entries of the contact's forces, shape (3 k,)
        self.mask = np.tile([not only_normal, not only_normal, True], k)
        self._normal = 0 if n == NORMAL else 2

    def write(
        self, state: RobotState, weight: float, resolution: Resolution, out: Array
    ) -> None:
        """Write f_ref."""
        self._follow(state.t)
        command = self._command.position.copy()
        command[self._normal] = max(command[self._normal] + self._offset[0], 0.0)
        contact = self._contact
        if self._varies:
            arms = contact.arms_in_axes(state.frame(contact.frame))
            self._shares[:] = shares(WRENCH, arms)
        out[:] = weight * (self._shares @ command)
        if isinstance(contact, SlidingContact) and contact.slides:
            slip = _slip(contact, state, intended_velocity(state, resolution))
            speed = float(np.hypot(slip[0], slip[1]))
            if speed > 0.0:
                share = np.tanh(speed / contact.smoothing) / speed
                out[:2] = -contact.friction * share * out[2] * slip[:2]


def _slip(contact: Contact, state: RobotState, v: Array) -> Array:
    """Return the velocity of the first point in the contact's axes, (3,) [m/s]."""
    frame = state.frame(contact.frame)
    twist, arm = frame.jacobian @ v, contact.arms(frame)[0]
    return np.asarray((twist[:3] + np.cross(twist[3:], arm)) @ contact.axes)


def intended_velocity(state: RobotState, resolution: Resolution) -> Array:
    """Return v + e_N + J# e', shape (nv,): the velocity once both errors are zero.

    Measurement noise cancels in it, and a hand that sticks is pushed where it is to go.
    """
    problem = resolution.problem
    L, J = problem.metric.L, problem.task.jacobian
    whitened = np.linalg.solve(L, J.T)
    motion = np.linalg.pinv(whitened.T, rcond=1e-6) @ problem.task.error_rate
    raised = np.linalg.solve(L.T, motion)
    return np.asarray(state.v + resolution.null_space_error + raised)
