"""Desired motions of the hand: commanded and extrapolated."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.companions.franka.layouts import PERIOD

_TOLERANCE = 1e-5
"""Tolerance of a rotation matrix, as in libfranka's ``checkMatrix``."""


class HandMotion(NamedTuple):
    """A commanded motion of the end effector, in the base's axes.

    Attributes:
        pose: Its placement.
        twist: Velocity and angular velocity, shape (6,) [m/s, rad/s].
        acceleration: Their derivatives, shape (6,) [m/s², rad/s²].
    """

    pose: pin.SE3
    twist: Array
    acceleration: Array


def at_rest(pose: pin.SE3) -> HandMotion:
    """Return the motion at rest."""
    return HandMotion(pose, np.zeros(6), np.zeros(6))


def as_commanded(motion: HandMotion) -> HandMotion:
    """Return a motion as its client receives it, see `reference.as_commanded`."""
    pose = motion.pose
    rotation, position, twist, acceleration = (
        x.astype(np.float32).astype(float)
        for x in (pose.rotation, pose.translation, motion.twist, motion.acceleration)
    )
    return HandMotion(pin.SE3(rotation, position), twist, acceleration)


def displacement(pose: pin.SE3, before: pin.SE3) -> Array:
    """Return translation and rotation vector in the base's axes, shape (6,)."""
    turned = pin.log3(pose.rotation @ before.rotation.T)
    return np.concatenate([pose.translation - before.translation, turned])


def to_pose(pose: pin.SE3, before: HandMotion) -> HandMotion:
    """Return the motion continued by a commanded pose (backward Euler)."""
    twist = displacement(pose, before.pose) / PERIOD
    return HandMotion(pose, twist, (twist - before.twist) / PERIOD)


def to_twist(twist: Array, before: HandMotion) -> HandMotion:
    """Return the motion continued by a commanded twist, shape (6,)."""
    rotation = pin.exp3(PERIOD * twist[3:]) @ before.pose.rotation
    position = before.pose.translation + PERIOD * twist[:3]
    pose = pin.SE3(rotation, position)
    return HandMotion(pose, twist, (twist - before.twist) / PERIOD)


def extrapolated(before: HandMotion) -> HandMotion:
    """Return the motion after a lost command: the acceleration stays."""
    return to_twist(before.twist + PERIOD * before.acceleration, before)


def placement(columns: Array) -> pin.SE3 | None:
    """Return the placement of a matrix stored by columns; None if it is not one."""
    matrix = np.array(columns, dtype=float).reshape(4, 4).T
    if not np.isfinite(matrix).all():
        return None
    R, last = matrix[:3, :3], matrix[3]
    rotates = np.abs(R.T @ R - np.eye(3)).max() < _TOLERANCE and np.linalg.det(R) > 0.0
    if not (rotates and np.abs(last - [0.0, 0.0, 0.0, 1.0]).max() < _TOLERANCE):
        return None
    return pin.SE3(R, matrix[:3, 3])
