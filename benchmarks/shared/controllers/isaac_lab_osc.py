"""Operational-space control with damped inertia, as Isaac Lab has it since 2026.

    tau = JᵀΛ(Kp e - Kd J v) + (M - JᵀΛ J) a_0 + G,   Λ = V diag(1 / (λ_i + d_i)) Vᵀ

with the eigenvalues λ_i and eigenvectors V of J M⁻¹Jᵀ. A direction whose λ_i is less
than 1e-5 of the largest is damped by d_i = 1e-5 λ_max; up to 1e-4 the damping falls to
zero as a cubic smooth step. Full inertial decoupling, stiffness, damping ratio and null
space are those of its environment Isaac-Reach-Franka-OSC; a_0 leads to the middle of
the joints' ranges, where there are more joints than rows.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

if TYPE_CHECKING:  # runs without this package
    from shared.edge_loop import Case, Compute

STIFFNESS, POSTURE = 100.0, 10.0  # critically damped [1/s²]
WEAKEST, WEAK = 1e-5, 1e-4  # eigenvalues, as parts of the largest


def make(case: "Case", model: Any) -> "Compute":
    """Return the controller."""
    data, frame, rows = model.createData(), model.getFrameId(case.frame), case.rows
    middle = 0.5 * (model.lowerPositionLimit + model.upperPositionLimit)
    axes = pin.LOCAL_WORLD_ALIGNED

    def compute(t: float, q: Any, v: Any) -> Any:
        pin.computeAllTerms(model, data, q, v)
        pin.updateFramePlacements(model, data)
        pose, M = data.oMf[frame], data.M
        J = pin.getFrameJacobian(model, data, frame, axes)[:rows]
        e = np.concatenate(
            [
                case.desired(t).position - pose.translation,
                pose.rotation @ pin.log3(pose.rotation.T @ case.rotation),
            ]
        )[:rows]
        a_x = STIFFNESS * e - 2.0 * np.sqrt(STIFFNESS) * (J @ v)
        Lambda = damped_inverse(J @ np.linalg.solve(M, J.T))
        tau = J.T @ Lambda @ a_x + pin.computeGeneralizedGravity(model, data, q)
        if model.nv > rows:
            a_0 = POSTURE * (middle - q) - 2.0 * np.sqrt(POSTURE) * v
            tau += M @ a_0 - J.T @ Lambda @ (J @ a_0)
        return tau

    return compute


def damped_inverse(A: Any) -> Any:
    """Return Λ of A = J M⁻¹Jᵀ."""
    values, V = np.linalg.eigh(A)
    share = np.clip((values / values[-1] - WEAKEST) / (WEAK - WEAKEST), 0.0, 1.0)
    damping = WEAKEST * values[-1] * (1.0 - share**2 * (3.0 - 2.0 * share))
    return V @ np.diag(1.0 / (values + damping)) @ V.T
