"""Operational-space control as robosuite's OSC_POSE has it.

    tau = J_xᵀΛ_x f + J_rᵀΛ_r m + (I - Jᵀ Λ J M⁻¹) M a_0 + N

Position and rotation are decoupled from each other, and the inverses Λ_x and Λ_r leave
out the directions with a singular value of J M⁻¹Jᵀ below 2.5e-4. Λ of the null space is
the plain inverse. Gains are those of ``osc_pose.json``, a_0 leads to the start with its
``joint_kp``; all are critically damped. For a position, only the rows of x.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

if TYPE_CHECKING:  # runs without this package
    from shared.edge_loop import Case, Compute

STIFFNESS, POSTURE = 150.0, 10.0  # [1/s²]
LEAST = 2.5e-4  # singular value that is inverted


def make(case: "Case", model: Any) -> "Compute":
    """Return the controller."""
    data, frame, rows = model.createData(), model.getFrameId(case.frame), case.rows
    axes = pin.LOCAL_WORLD_ALIGNED

    def compute(t: float, q: Any, v: Any) -> Any:
        pin.computeAllTerms(model, data, q, v)
        pin.updateFramePlacements(model, data)
        pose, M, M_inv = data.oMf[frame], data.M, np.linalg.inv(data.M)
        J = pin.getFrameJacobian(model, data, frame, axes)[:rows]
        e = np.concatenate(
            [
                case.desired(t).position - pose.translation,
                pose.rotation @ pin.log3(pose.rotation.T @ case.rotation),
            ]
        )[:rows]
        a_x = STIFFNESS * e - 2.0 * np.sqrt(STIFFNESS) * (J @ v)
        tau = np.array(data.nle)
        for part in (slice(0, 3), slice(3, 6))[: rows // 3]:
            tau += J[part].T @ cut_inverse(J[part] @ M_inv @ J[part].T) @ a_x[part]
        a_0 = POSTURE * (case.q0 - q) - 2.0 * np.sqrt(POSTURE) * v
        Lambda = np.linalg.inv(J @ M_inv @ J.T)
        return tau + M @ a_0 - J.T @ (Lambda @ (J @ a_0))

    return compute


def cut_inverse(A: Any) -> Any:
    """Return the inverse without the directions that A nearly loses."""
    U, s, Vt = np.linalg.svd(A)
    inverses = np.where(s < LEAST, 0.0, 1.0 / np.maximum(s, LEAST))
    return Vt.T @ np.diag(inverses) @ U.T
