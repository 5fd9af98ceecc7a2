"""Homogeneous transforms, shape (4, 4)."""

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array


def pose_at(position: ArrayLike) -> Array:
    """Return the pose with a position [m] and no rotation, shape (4, 4)."""
    pose = np.eye(4)
    pose[:3, 3] = position
    return pose


def pose_along(direction: Array) -> Array:
    """Return the smallest rotation of z to a direction, as a pose of shape (4, 4)."""
    z = np.array([0.0, 0.0, 1.0])
    turn = pin.Quaternion.FromTwoVectors(z, direction / np.linalg.norm(direction))
    pose = np.eye(4)
    pose[:3, :3] = turn.toRotationMatrix()
    return pose


def quaternions_along(directions: Array) -> Array:
    """Return the smallest rotations of z to directions, quaternions, shape (N, 4)."""
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    x, y, z = (directions / np.where(lengths > 0.0, lengths, 1.0)).T
    turns = np.column_stack([-y, x, np.zeros_like(x), 1.0 + z])
    sizes = np.linalg.norm(turns, axis=1, keepdims=True)
    straight_down = np.array([1.0, 0.0, 0.0, 0.0])
    return np.where(sizes > 1e-9, turns / np.maximum(sizes, 1e-9), straight_down)
