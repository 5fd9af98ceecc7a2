"""A floating root has no motor."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot

ROUNDING = 1e-3
"""What a solver may leave of the effort on a root [N or N·m]; it is dropped."""


class FloatingRoots:
    """The freedoms of a robot that no motor moves."""

    def __init__(self, robot: Robot) -> None:
        """Find them: those of free-flyers."""
        self._unmoved = np.zeros(robot.nv, dtype=bool)
        for joint in robot.joints.values():
            if joint.shortname() == "JointModelFreeFlyer":
                self._unmoved[joint.idx_v : joint.idx_v + 6] = True

    def without(self, t: float, tau: Array) -> Array:
        """Return an effort with nothing on the roots.

        Raises:
            SimulationError: If it would move one.
        """
        largest = float(np.abs(tau[self._unmoved]).max(initial=0.0))
        if largest > ROUNDING:
            raise SimulationError(
                f"the effort at t = {t:.6g} s pushes the floating root with "
                f"{largest:.3g} N or N·m, and no motor is there: the controller must "
                "move it through its contacts"
            )
        return np.where(self._unmoved, 0.0, tau)
