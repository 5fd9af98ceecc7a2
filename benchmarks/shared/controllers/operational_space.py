"""Operational-space control with a posture task, as in textbooks (Khatib 1987).

    tau = JᵀΛ(a_x - J'v) + (I - Jᵀ J̄ᵀ) M a_0 + N,   Λ = (J M⁻¹ Jᵀ)⁻¹,   J̄ = M⁻¹JᵀΛ

Dynamically consistent: the posture's effort does not accelerate the hand. It contains
the drift J'v, which many implementations omit. Plain NumPy.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

if TYPE_CHECKING:  # also runs without this package: see placo_side.py
    from hsp_control.common.arrays import Array
    from shared.cases import Case


def make(case: "Case") -> "Callable[[float, Array, Array], Array]":
    """Return the controller."""
    model, rows = case.robot.model, case.rows
    data, frame = model.createData(), model.getFrameId(case.frame)
    axes = pin.LOCAL_WORLD_ALIGNED

    def compute(t: float, q: "Array", v: "Array") -> "Array":
        pin.computeAllTerms(model, data, q, v)
        pin.updateFramePlacements(model, data)
        M, N, pose = data.M, data.nle, data.oMf[frame]
        J = pin.getFrameJacobian(model, data, frame, axes)[:rows]
        drift = pin.getFrameJacobianTimeVariation(model, data, frame, axes)[:rows] @ v

        x, R = case.desired(t)
        e = np.concatenate(
            [
                x.position - pose.translation,
                pose.rotation @ pin.log3(pose.rotation.T @ R.rotation),
            ]
        )
        rate = np.concatenate([x.velocity, R.angular_velocity])[:rows] - J @ v
        feed_forward = np.concatenate([x.acceleration, R.angular_acceleration])
        a_x = feed_forward[:rows] + case.kv * rate + case.kp * e[:rows]

        M_inv = np.linalg.inv(M)
        Lambda = np.linalg.inv(J @ M_inv @ J.T)
        J_bar = M_inv @ J.T @ Lambda
        a_0 = case.posture_acceleration(t, q, v)
        posture = (np.eye(len(v)) - J.T @ J_bar.T) @ (M @ a_0)
        return J.T @ Lambda @ (a_x - drift) + posture + N

    return compute
