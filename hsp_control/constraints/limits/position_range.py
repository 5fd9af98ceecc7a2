"""Joint position limits in numbers, for all joints or for some."""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.constraints.limits.numbers_by_joint import (
    Numbers,
    by_dof,
    of_joints,
)
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import ArrayField, Number
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
            raise LimitError(f"{_unlimited(robot, wrong[0])}; its limits must be None")
        return lower, upper


class PositionsByJoint(Part, error=LimitError):
    """Position limits of some joints; the others keep the robot's own."""

    joints: Annotated[
        Mapping[str, tuple[float, float]],
        ArrayField(
            Annotated[dict[str, tuple[Number, Number]], Field(min_length=1)], of_joints
        ),
    ]
    """Lower and upper limit by joint name [rad or m]."""

    def __post_init__(self) -> None:
        """Check that lower limits are below upper ones."""
        for joint, (lower, upper) in self.joints.items():
            if lower >= upper:
                raise LimitError(
                    f"joints.{joint}: lower must be below upper; got {lower}, {upper}"
                )

    def of(self, robot: Robot) -> tuple[Array, Array]:
        """Return lower and upper limits, shape (nv,); ±inf where there is none.

        Raises:
            JointNotFoundError: If a joint does not exist.
            LimitError: If a joint has no single coordinate.
        """
        lower, upper = (each.copy() for each in robot.position_limits())
        for joint, limits in self.joints.items():
            with within("joints", joint):
                dof = robot.velocity_index(joint).start
                if robot.dof_indices[dof] < 0:
                    raise LimitError(f"{_unlimited(robot, dof)}: it has no limits")
                lower[dof], upper[dof] = limits
        return lower, upper


def _unlimited(robot: Robot, dof: int) -> str:
    return (
        f"{robot.dof_names[dof]} belongs to a joint without a single coordinate (a "
        "root, or a continuous joint)"
    )
