"""The controllers inside the box: impedances of the joints, or of the hand."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.franka.layouts import JOINTS, PERIOD
from hsp_control.companions.franka_box.model import Model
from hsp_control.companions.franka_box.reflexes import Reference

JOINT_STIFFNESS = np.array([3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0])
"""Default stiffness of the joints [N·m/rad]; this and the next from libfranka's
examples, ``setDefaultBehavior``."""
CARTESIAN_STIFFNESS = np.array([3000.0, 3000.0, 3000.0, 300.0, 300.0, 300.0])
"""Default stiffness along and about the axes of the stiffness frame [N/m, N·m/rad]."""
_NULL_SPACE_STIFFNESS = 100.0
"""Stiffness of the posture under an impedance of the hand [N·m/rad], not published."""
_NULL_SPACE_DAMPING = 20.0
"""Damping of the posture [N·m·s/rad]."""
_SINGULAR = 0.03
"""Share of the largest singular value below which a direction is in the null space."""


class ArmImpedance(NamedTuple):
    """A spring and a damper between an arm and its desired motion.

    Attributes:
        stiffness: K, shape (7, 7) [N·m/rad].
        damping: D, shape (7, 7) [N·m·s/rad].
    """

    stiffness: Array
    damping: Array


def of_joints(model: Model, stiffness: Array) -> ArmImpedance:
    """Return a spring in every joint, shape (7,) [N·m/rad], critically damped."""
    damping = 2.0 * np.sqrt(stiffness * np.diag(model.state.mass_matrix))
    return ArmImpedance(np.diag(stiffness), np.diag(damping))


def of_hand(model: Model, stiffness: Array) -> ArmImpedance:
    """Return springs along and about the axes of the stiffness frame.

        K = Jᵀ K_x J + k (1 - J⁺J)

    with the Jacobian J of the frame in its own axes: K (q_d - q) is Jᵀ K_x times the
    hand's error, to first order. The axes are critically damped for their own inertia,
    1 / (J M⁻¹ Jᵀ)_ii.
    """
    J = model.stiffness_jacobian()
    mobility = np.einsum("ij,ji->i", J, np.linalg.solve(model.state.mass_matrix, J.T))
    damping = 2.0 * np.sqrt(stiffness / mobility)
    free = np.eye(JOINTS) - np.linalg.pinv(J, rcond=_SINGULAR) @ J
    return ArmImpedance(
        (J.T * stiffness) @ J + _NULL_SPACE_STIFFNESS * free,
        (J.T * damping) @ J + _NULL_SPACE_DAMPING * free,
    )


def tracking_effort(model: Model, wanted: Reference, impedance: ArmImpedance) -> Array:
    """Return the effort without gravity that tracks a motion, shape (7,) [N·m].

        (M + h D + h² K) x = K (e + h e') + D e',    tau = M (q̈_d + x) + C v

    for the error e = q_d - q: the spring and the damper as they act at the end of the
    period h. So it is stable for every K and D at this rate (J. Tan, K. Liu, G. Turk,
    "Stable proportional-derivative controllers", 2011); where an oscillation would take
    about a period h, the arm is softer than K.
    """
    state, h, (K, D) = model.state, PERIOD, impedance
    error, rate = wanted.q - state.q, wanted.dq - state.v
    pull = K @ (error + h * rate) + D @ rate
    implicit = state.mass_matrix + h * D + h * h * K
    acceleration = wanted.ddq + np.linalg.solve(implicit, pull)
    return np.asarray(state.inverse_dynamics(acceleration) - model.gravity)
