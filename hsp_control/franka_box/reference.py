"""Desired motions of the joints, and the controller inside the box that tracks them."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.franka_box.arm import ACCELERATION
from hsp_control.franka_box.reflexes import Reference
from hsp_control.franka_box.wire import JOINTS, PERIOD
from hsp_control.robot import RobotState

STIFFNESS = np.array([3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0])
"""Joint stiffness unless a client sets another one [N·m/rad]: that of libfranka's
examples, ``setDefaultBehavior``."""
RETREAT_SPEED = 0.2
"""Speed of the way back into the range that is allowed [rad/s]."""


def at_rest(q: Array) -> Reference:
    """Return the motion that stands still at q, shape (7,) [rad]."""
    return Reference(q, _REST, _REST)


def as_told(reference: Reference) -> Reference:
    """Return a motion as its client is told it: in single precision.

    From there the client continues, and so its command is differentiated from there;
    otherwise rounding alone would be a jerk of some 100 rad/s³.
    """
    return Reference(*(x.astype(np.float32).astype(float) for x in reference))


def to_position(q: Array, before: Reference) -> Reference:
    """Return the motion that a commanded position continues (backward Euler).

    Args:
        q: The position, shape (7,) [rad].
        before: The motion a period before.
    """
    dq = (q - before.q) / PERIOD
    return Reference(q, dq, (dq - before.dq) / PERIOD)


def to_velocity(dq: Array, before: Reference) -> Reference:
    """Return the motion that a commanded velocity continues; see `to_position`."""
    return Reference(before.q + PERIOD * dq, dq, (dq - before.dq) / PERIOD)


def extrapolated(before: Reference) -> Reference:
    """Return the motion after a lost command: the acceleration stays."""
    return to_velocity(before.dq + PERIOD * before.ddq, before)


def braking(before: Reference) -> Reference:
    """Return the motion that brakes each joint with the largest acceleration."""
    most = ACCELERATION * PERIOD
    return to_velocity(before.dq - np.clip(before.dq, -most, most), before)


def retreating(goal: Array, before: Reference) -> Reference:
    """Return the next posture on the slow way to a near one, shape (7,) [rad]."""
    most = RETREAT_SPEED * PERIOD
    return at_rest(before.q + np.clip(goal - before.q, -most, most))


def impedance_effort(state: RobotState, wanted: Reference, stiffness: Array) -> Array:
    """Return the effort without gravity that tracks a motion, shape (7,) [N·m].

        (M + h D + h² K) x = K (e + h e') + D e',    tau = M (q̈_d + x) + C v

    for the error e = q_d - q: a spring K and a damper D, critical for each joint's own
    inertia, as they act at the end of the period h. So it is stable for every stiffness
    at this rate (J. Tan, K. Liu, G. Turk, "Stable proportional-derivative controllers",
    2011); a joint whose period of oscillation is near h is softer than K.

    Args:
        state: The measured state, with the model that carries the load.
        wanted: The motion.
        stiffness: K, shape (7,) [N·m/rad].
    """
    M, h = state.mass_matrix, PERIOD
    damping = 2.0 * np.sqrt(stiffness * np.diag(M))
    error, rate = wanted.q - state.q, wanted.dq - state.v
    pull = stiffness * (error + h * rate) + damping * rate
    implicit = M + np.diag(h * damping + h * h * stiffness)
    acceleration = wanted.ddq + np.linalg.solve(implicit, pull)
    gravity = state.robot.inverse_dynamics(state.q, _REST, _REST)
    return np.asarray(state.inverse_dynamics(acceleration) - gravity)


_REST = np.zeros(JOINTS)
