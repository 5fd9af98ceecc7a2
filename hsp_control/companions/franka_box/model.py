"""Quantities of the box's own model: gravity, poses, external forces."""

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.companions.franka.layouts import JOINTS, PERIOD
from hsp_control.companions.franka_box.arm import Arm
from hsp_control.control.interface import MomentumObserver
from hsp_control.robot import RobotState

OBSERVER = MomentumObserver(50.0, cancel=False)
"""Bandwidth of the estimated external efforts; Franka's own is not published."""
_SINGULAR = 1e-3
"""Eigenvalue of J Jᵀ below which no wrench is estimated (σ = 0.03)."""


class Model:
    """The arm with its end effector and the load that a client has set.

    It lacks the friction and the payload of the simulated arm.

    Attributes:
        arm: The arm.
        state: The measured state, with all terms of the model.
        load: The load in the flange's frame.
        NE_T_EE: Placement of the end effector in the nominal one.
        EE_T_K: Placement of the stiffness frame in the end effector.
        external_effort: tau_J less the effort that the model explains, shape (7,)
            [N·m]: positive where the arm pushes.
    """

    def __init__(self, arm: Arm) -> None:
        """Begin without a load, at rest in the arm's home."""
        self.arm = arm
        self.NE_T_EE: pin.SE3 = pin.SE3.Identity()
        self.EE_T_K: pin.SE3 = pin.SE3.Identity()
        self._rest = np.zeros(JOINTS)
        self._desired = arm.robot.model.createData()
        self.external_effort: Array = np.zeros(JOINTS)
        self.carry(pin.Inertia.Zero())

    def carry(self, load: pin.Inertia) -> None:
        """Set the load, in the flange's frame."""
        self.load = load
        robot = self.arm.carrying(load)
        self.state = RobotState(robot).update(0.0, robot.home(), self._rest)
        self._observer = OBSERVER.begin(robot)

    def measure(self, t: float, q: Array, v: Array, tau: Array) -> None:
        """Update to a measured state."""
        self.state.update(t, q, v)
        disturbance = self._observer.update(self.state, tau, PERIOD)
        np.negative(disturbance, out=self.external_effort)

    @property
    def gravity(self) -> Array:
        """g(q), shape (7,) [N·m]."""
        robot = self.state.robot
        return robot.inverse_dynamics(self.state.q, self._rest, self._rest)

    @property
    def F_T_EE(self) -> pin.SE3:
        """Placement of the end effector in the flange."""
        return self.arm.nominal_end_effector * self.NE_T_EE

    @property
    def O_T_EE(self) -> pin.SE3:
        """Placement of the end effector in the base, measured."""
        return self.state.data.oMi[JOINTS] * self.arm.flange * self.F_T_EE

    def hand_at(self, q: Array) -> tuple[pin.SE3, Array]:
        """Return the end effector's pose and Jacobian, shape (6, 7), at any q."""
        model, data = self.arm.robot.model, self._desired
        pin.computeJointJacobians(model, data, q)
        hand = data.oMi[JOINTS] * self.arm.flange * self.F_T_EE
        return hand, _jacobian(model, data, hand.translation)

    @property
    def is_singular(self) -> bool:
        """Whether the hand cannot move in every direction."""
        J = self.stiffness_jacobian()
        return bool(np.linalg.eigvalsh(J @ J.T)[0] < _SINGULAR)

    def stiffness_jacobian(self) -> Array:
        """Return the Jacobian of the stiffness frame in its axes, shape (6, 7)."""
        K = self.O_T_EE * self.EE_T_K
        J = _jacobian(self.state.robot.model, self.state.data, K.translation)
        return np.vstack([K.rotation.T @ J[:3], K.rotation.T @ J[3:]])

    def external_wrench(self) -> tuple[Array, Array]:
        """Return the wrench of the arm on its surroundings at K, shapes (6,).

        In the base's axes and in those of K; zero near a singularity.
        """
        K = self.O_T_EE * self.EE_T_K
        J = _jacobian(self.state.robot.model, self.state.data, K.translation)
        square = J @ J.T
        if np.linalg.eigvalsh(square)[0] < _SINGULAR:
            return np.zeros(6), np.zeros(6)
        wrench = np.asarray(np.linalg.solve(square, J @ self.external_effort), float)
        turned: Array = np.concatenate(
            [K.rotation.T @ wrench[:3], K.rotation.T @ wrench[3:]]
        )
        return wrench, turned


def _jacobian(model: pin.Model, data: pin.Data, point: Array) -> Array:
    """Return the Jacobian of a point of the last link, shape (6, 7), base's axes."""
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    J: Array = pin.getJointJacobian(model, data, JOINTS, axes)
    lever = point - data.oMi[JOINTS].translation
    J[:3] -= pin.skew(lever) @ J[3:]
    return J
