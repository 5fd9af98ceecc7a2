"""Homogeneous transforms, shape (4, 4)."""

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.arrays import Array


def moved_to(position: ArrayLike) -> Array:
    """Return the pose that only moves, to a position [m]."""
    pose = np.eye(4)
    pose[:3, 3] = position
    return pose


def along(direction: Array) -> Array:
    """Return the pose that turns z along a direction the shortest way."""
    z = np.array([0.0, 0.0, 1.0])
    turn = pin.Quaternion.FromTwoVectors(z, direction / np.linalg.norm(direction))
    pose = np.eye(4)
    pose[:3, :3] = turn.toRotationMatrix()
    return pose
