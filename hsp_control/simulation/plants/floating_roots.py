"""Removes the effort on floating roots, which have no motor."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot

MAX_ROOT_EFFORT = 1e-3
"""Largest effort on a root [N or N·m] that a solver's tolerance explains; removed."""


class FloatingRoots:
    """The degrees of freedom of a robot's free-flyer joints."""

    def __init__(self, robot: Robot) -> None:
        self._unactuated = np.zeros(robot.nv, dtype=bool)
        for joint in robot.joints.values():
            if joint.shortname() == "JointModelFreeFlyer":
                self._unactuated[joint.idx_v : joint.idx_v + 6] = True

    def remove_effort(self, t: float, tau: Array) -> Array:
        """Return an effort, shape (nv,), with zeros for the roots."""
        largest = float(np.abs(tau[self._unactuated]).max(initial=0.0))
        if largest > MAX_ROOT_EFFORT:
            raise SimulationError(
                f"the effort at t = {t:.6g} s pushes the floating root with "
                f"{largest:.3g} N or N·m, but the root has no motor: the controller "
                "must move it through its contacts"
            )
        return np.where(self._unactuated, 0.0, tau)
