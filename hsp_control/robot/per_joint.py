"""Settings that are one number for all joints, or one for each freedom."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot.robot import Robot


def joint_dofs(robot: Robot) -> NDArray[np.bool_]:
    """Return which freedoms belong to joints with one, shape (nv,).

    The others are those of a root or of a ball joint, which have no motor, no gear and
    no encoder.
    """
    joints = np.zeros(robot.nv, dtype=bool)
    joints[[j.idx_v for j in robot.joints.values() if j.nv == 1]] = True
    return joints


def per_dof(robot: Robot, value: Any, what: str) -> Array:
    """Return a setting for each freedom, shape (nv,).

    Args:
        robot: The robot.
        value: One number, which is that of all joints with one freedom (a root has 0),
            or a number for each freedom.
        what: Its name, for messages.

    Raises:
        SimulationError: If a number is negative, not finite, or there are too many.
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise SimulationError(f"{what} is {value!r}; needs numbers") from None
    if array.shape not in ((), (robot.nv,)):
        raise SimulationError(
            f"{what} has shape {array.shape}; needs one number, or one for each of the "
            f"{robot.nv} freedoms of {robot.name}"
        )
    if not (np.isfinite(array).all() and (array >= 0.0).all()):
        raise SimulationError(f"{what} is {array.tolist()}; must not be negative")
    return np.where(joint_dofs(robot), array, 0.0) if array.ndim == 0 else array
