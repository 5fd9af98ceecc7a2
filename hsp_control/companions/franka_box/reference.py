"""Desired motions of the joints: commanded, extrapolated, braking, retreating."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.franka.layouts import JOINTS, PERIOD
from hsp_control.companions.franka_box.arm import ACCELERATION
from hsp_control.companions.franka_box.reflexes import Reference

RETREAT_SPEED = 0.2
"""Speed of the return into the permitted range [rad/s]."""


def at_rest(q: Array) -> Reference:
    """Return the motion at rest at q, shape (7,) [rad]."""
    return Reference(q, _REST, _REST)


def as_commanded(reference: Reference) -> Reference:
    """Return a motion as its client receives it: in single precision.

    From there the client continues, and so its command is differentiated from there;
    otherwise rounding alone would be a jerk of some 100 rad/s³.
    """
    return Reference(*(x.astype(np.float32).astype(float) for x in reference))


def to_position(q: Array, before: Reference) -> Reference:
    """Return the motion continued by a commanded position (backward Euler)."""
    dq = (q - before.q) / PERIOD
    return Reference(q, dq, (dq - before.dq) / PERIOD)


def to_velocity(dq: Array, before: Reference) -> Reference:
    """Return the motion continued by a commanded velocity; see `to_position`."""
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


_REST = np.zeros(JOINTS)
