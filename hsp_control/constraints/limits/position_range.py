"""Joint position limits in numbers."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.constraints.limits.numbers_by_joint import Numbers, by_dof
from hsp_control.declaration import Part, within
from hsp_control.robot import Robot


class PositionRange(Part, error=LimitError):
    """Joint position limits in numbers.

    Joints without a single coordinate (roots, continuous joints) can have none.
    """

    lower: Numbers
    """Lower joint position limits, one number or nv, None for no limit [rad or m]."""
    upper: Numbers
    """Upper joint position limits, one number or nv, None for no limit [rad or m]."""

    def __post_init__(self) -> None:
        """Check that lower limits are below upper ones."""
        pairs: Any = (self.lower, self.upper)
        lower, upper = (np.array(each, dtype=float) for each in pairs)
        if lower.ndim and upper.ndim and lower.shape != upper.shape:
            raise LimitError(
                f"lower has {len(lower)} numbers and upper {len(upper)}; needs as many"
            )
        if (lower >= upper).any():  # None is NaN here, and never crosses
            raise LimitError(
                f"lower must be below upper; got lower {self.lower}, upper {self.upper}"
            )

    def of(self, robot: Robot) -> tuple[Array, Array]:
        """Return lower and upper limits, shape (nv,); ±inf where there is none.

        Raises:
            LimitError: If they do not fit the robot.
        """
        with within("lower"):
            lower = by_dof(self.lower, robot.nv, -np.inf)
        with within("upper"):
            upper = by_dof(self.upper, robot.nv)
        limited = np.isfinite(lower) | np.isfinite(upper)
        wrong = np.flatnonzero(limited & (robot.dof_indices < 0))
        if wrong.size:
            raise LimitError(
                f"{robot.dof_names[wrong[0]]} belongs to a joint without a single "
                "coordinate (a root, or a continuous joint); its limits must be None"
            )
        return lower, upper
