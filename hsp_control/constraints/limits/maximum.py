"""Maximum efforts and speeds: the robot's own, changed or scaled, or numbers."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Field

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.constraints.limits.numbers_by_joint import (
    Positives,
    by_dof,
    of_joints,
)
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import ArrayField, Positive
from hsp_control.robot import Robot

_PositiveOfJoints = Annotated[dict[str, Positive], Field(min_length=1)]


class Scaled(Part, error=LimitError):
    """The robot's own limit, multiplied by a factor."""

    scale: Annotated[
        float | Mapping[str, float],
        ArrayField(Positive | _PositiveOfJoints, of_joints),
    ]
    """The factor [-]; 0.5 halves the limit. Or factors by joint name; the other joints
    keep their own limits."""

    def of(self, own: Array, robot: Robot) -> Array:
        """Return the robot's own limit, scaled, shape (nv,).

        Raises:
            JointNotFoundError: If a joint does not exist.
            LimitError: If a joint has no limit of its own.
        """
        if not isinstance(self.scale, Mapping):
            return self.scale * own
        scaled = own.copy()
        for joint, factor in self.scale.items():
            with within("scale", joint):
                dofs = robot.velocity_index(joint)
                if not np.isfinite(own[dofs]).all():
                    raise LimitError(f"{joint} has no limit that could be scaled")
                scaled[dofs] *= factor
        return scaled


class ByJoint(Part, error=LimitError):
    """Numbers for some joints; the others keep the robot's own limits."""

    joints: Annotated[Mapping[str, float], ArrayField(_PositiveOfJoints, of_joints)]
    """Limits by joint name [N·m or N, rad/s or m/s]."""

    def of(self, own: Array, robot: Robot) -> Array:
        """Return the robot's own limit with these numbers, shape (nv,).

        Raises:
            JointNotFoundError: If a joint does not exist.
            LimitError: If no motor moves a joint.
        """
        limit = own.copy()
        for joint, number in self.joints.items():
            with within("joints", joint):
                dofs = robot.velocity_index(joint)
                if dofs.start in robot.unactuated:
                    raise LimitError(f"no motor moves {joint}")
                limit[dofs] = number
        return limit


def none_for_nothing(value: Any) -> Any:
    """Return "none" for None: both say that there is no limit."""
    return "none" if value is None else value


Maximum: TypeAlias = Annotated[
    Literal["robot", "none"] | Scaled | ByJoint | Positives | None,
    BeforeValidator(none_for_nothing),
]
"""The robot's own limit, none (or None), the robot's own scaled, with numbers for some
joints, or numbers for all."""


def maximum(value: Maximum, own: Array, robot: Robot) -> Array:
    """Return a maximum effort or speed (nv,), of the robot's own; inf for none."""
    if isinstance(value, Scaled | ByJoint):
        return value.of(_own_limit(own, robot), robot)
    if isinstance(value, str):
        if value == "none":
            return np.full(robot.nv, np.inf)
        return _own_limit(own, robot)
    return by_dof(value, robot.nv)


def _own_limit(own: Array, robot: Robot) -> Array:
    limit = np.array(own, dtype=float)
    limit[list(robot.unactuated)] = np.inf
    # URDFs have 0 or the largest float where there is no limit.
    limit[(limit <= 0.0) | (limit >= np.finfo(np.float32).max)] = np.inf
    return limit
