"""Cartesian impedance by the transposed Jacobian, as crisp_controllers has it.

    tau = Jᵀ(K e - D J v) + clip((I - J⁺J)(k (q_0 - q) - d v)) + r(q) + N

Nothing is inverted. The error is clipped, the target passes a low-pass filter, and the
effort without gravity changes by 0.5 N·m in a period at most. r pushes away from the
ends of the joints. franky's impedance has the same form. Gains are those of crisp_py's
``default_cartesian_impedance.yaml``, for a Franka; the rest are crisp_controllers' own
defaults. J and e are in axes of the hand.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

if TYPE_CHECKING:  # runs without this package
    from shared.edge_loop import Case, Compute

STIFFNESS = np.array([600.0, 600.0, 600.0, 30.0, 30.0, 30.0])  # [N/m, N·m/rad]
DAMPING = np.array([60.0, 60.0, 60.0, 10.0, 10.0, 10.0])  # [N·s/m, N·m·s/rad]
LARGEST_ERROR = np.array([0.1, 0.1, 0.1, 0.5, 0.5, 0.5])  # [m, rad]
POSTURE = 5.0  # [N·m/rad], critically damped for a unit of inertia
LARGEST_POSTURE = 5.0  # [N·m]
REGULARIZATION = 1e-6  # of the pseudo-inverse
LARGEST_CHANGE = 0.5  # in a period [N·m]
SMOOTHING = 0.1  # share of the new target in a period
REPULSION, RANGE = 5.0, 0.1  # at a limit, and where it begins [N·m, rad]


def make(case: "Case", model: Any) -> "Compute":
    """Return the controller."""
    data, frame, rows = model.createData(), model.getFrameId(case.frame), case.rows
    K, D = STIFFNESS[:rows], DAMPING[:rows]
    lower, upper = model.lowerPositionLimit, model.upperPositionLimit
    target, sent = case.start.copy(), np.zeros(model.nv)
    unit = np.eye(model.nv)

    def compute(t: float, q: Any, v: Any) -> Any:
        target[:] += SMOOTHING * (case.desired(t).position - target)
        pin.computeAllTerms(model, data, q, v)
        pin.updateFramePlacements(model, data)
        pose = data.oMf[frame]
        J = pin.getFrameJacobian(model, data, frame, pin.LOCAL)[:rows]
        e = np.concatenate(
            [
                pose.rotation.T @ (target - pose.translation),
                pin.log3(pose.rotation.T @ case.rotation),
            ]
        )
        e = np.clip(e, -LARGEST_ERROR, LARGEST_ERROR)[:rows]
        U, s, Vt = np.linalg.svd(J, full_matrices=False)
        J_inv = Vt.T @ np.diag(s / (s**2 + REGULARIZATION**2)) @ U.T
        posture = POSTURE * (case.q0 - q) - 2.0 * np.sqrt(POSTURE) * v
        posture = (unit - J_inv @ J) @ posture
        near = np.clip([1.0 - (q - lower) / RANGE, 1.0 - (upper - q) / RANGE], 0.0, 1.0)
        gravity = pin.computeGeneralizedGravity(model, data, q)
        tau = (
            J.T @ (K * e - D * (J @ v))
            + np.clip(posture, -LARGEST_POSTURE, LARGEST_POSTURE)
            + REPULSION * (near[0] - near[1])
            + pin.nonLinearEffects(model, data, q, v)
            - gravity
        )
        sent[:] += np.clip(tau - sent, -LARGEST_CHANGE, LARGEST_CHANGE)
        return sent + gravity

    return compute
