"""Settings that are one number for all joints, or one per degree of freedom."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot.robot import Robot


def joint_dofs(robot: Robot) -> NDArray[np.bool_]:
    """Return a mask of the degrees of freedom of single-dof joints, shape (nv,)."""
    joints = np.zeros(robot.nv, dtype=bool)
    joints[[j.idx_v for j in robot.joints.values() if j.nv == 1]] = True
    return joints


def per_dof(robot: Robot, value: ArrayLike) -> Array:
    """Return a setting for each dof (nv,); one number is for all single-dof joints."""
    array = np.asarray(value, dtype=float)
    if array.shape not in ((), (robot.nv,)):
        raise SimulationError(
            f"has shape {array.shape}; needs one number, or one for each of the "
            f"{robot.nv} degrees of freedom of {robot.name}"
        )
    return np.where(joint_dofs(robot), array, 0.0) if array.ndim == 0 else array
