"""A robot state as it is sent: its fields are filled from the box's model."""

from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.companions.franka.layouts import PERIOD, STATE
from hsp_control.companions.franka_box.arm import ELBOW_FLIP
from hsp_control.companions.franka_box.hand import HandMotion
from hsp_control.companions.franka_box.model import Model
from hsp_control.companions.franka_box.reflexes import Reference, ReflexThresholds


class Readings:
    """The fields of a state.

    The accelerometers, which a simulated arm lacks, are zero. The motors'
    ``theta`` and ``dtheta`` are the joints' ``q`` and ``dq``.

    Attributes:
        fields: Views of the fields, by name; write into them.
    """

    def __init__(self) -> None:
        """Begin with zeros."""
        self._record = np.zeros(1, STATE)
        self.fields: dict[str, Any] = {
            name: self._record[name][0] if shape else self._record[name]
            for name, shape in ((n, STATE[n].shape) for n in STATE.names or ())
        }
        self._tau_J: Array | None = None

    def datagram(self) -> bytes:
        """Return the state as it is sent."""
        return self._record.tobytes()

    def set_end_effector(self, model: Model) -> None:
        """Fill frames, masses and inertias, which requests change; and gravity."""
        fields, arm = self.fields, model.arm
        fields["F_T_NE"][:] = _columns(arm.nominal_end_effector)
        fields["NE_T_EE"][:] = _columns(model.NE_T_EE)
        fields["F_T_EE"][:] = _columns(model.F_T_EE)
        fields["EE_T_K"][:] = _columns(model.EE_T_K)
        for name, body in (("ee", arm.end_effector), ("load", model.load)):
            fields[f"m_{name}"][0] = body.mass
            fields[f"F_x_C{name}"][:] = body.lever
            fields[f"I_{name}"][:] = body.inertia.T.ravel()
        fields["O_ddP_O"][:] = arm.robot.model.gravity.linear

    def set_desired(
        self, model: Model, reference: Reference, hand: HandMotion | None
    ) -> None:
        """Fill the desired motion, and the pose of the end effector."""
        fields = self.fields
        fields["O_T_EE"][:] = _columns(model.O_T_EE)
        fields["q_d"][:], fields["dq_d"][:], fields["ddq_d"][:] = reference
        pose, jacobian = model.hand_at(reference.q)
        desired = HandMotion(pose, jacobian @ reference.dq, np.zeros(6))
        fields["O_T_EE_d"][:] = _columns(pose)
        fields["O_dP_EE_d"][:] = desired.twist
        commanded = hand or desired
        fields["O_T_EE_c"][:] = _columns(commanded.pose)
        fields["O_dP_EE_c"][:] = commanded.twist
        fields["O_ddP_EE_c"][:] = commanded.acceleration
        fields["elbow_d"][:] = fields["elbow_c"][:] = _elbow(reference.q)
        fields["delbow_c"][0], fields["ddelbow_c"][0] = (
            reference.dq[2],
            reference.ddq[2],
        )

    def set_measured(
        self, model: Model, tau_J: Array, tau_J_d: Array, thresholds: ReflexThresholds
    ) -> Array:
        """Fill the measured fields, once a period."""
        fields, state = self.fields, model.state
        fields["q"][:] = fields["theta"][:] = state.q
        fields["dq"][:] = fields["dtheta"][:] = state.v
        before = tau_J if self._tau_J is None else self._tau_J
        fields["dtau_J"][:] = (tau_J - before) / PERIOD
        fields["tau_J"][:], self._tau_J = tau_J, tau_J
        fields["tau_J_d"][:] = tau_J_d
        fields["elbow"][:] = _elbow(state.q)
        wrench, turned = model.external_wrench()
        effort = model.external_effort
        fields["tau_ext_hat_filtered"][:] = effort
        fields["O_F_ext_hat_K"][:], fields["K_F_ext_hat_K"][:] = wrench, turned
        fields["joint_contact"][:] = abs(effort) > thresholds.lower_effort
        fields["cartesian_contact"][:] = abs(wrench) > thresholds.lower_wrench
        for name, values, upper in (
            ("joint_collision", effort, thresholds.upper_effort),
            ("cartesian_collision", wrench, thresholds.upper_wrench),
        ):
            np.maximum(fields[name], abs(values) > upper, out=fields[name])
        return wrench


def _columns(placement: pin.SE3) -> Array:
    return np.asarray(placement.homogeneous.T.ravel())


def _elbow(q: Array) -> tuple[float, float]:
    return float(q[2]), float(np.sign(q[3] - ELBOW_FLIP))
