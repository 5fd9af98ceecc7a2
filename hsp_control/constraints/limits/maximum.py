"""Maximum efforts and speeds: the robot's own, a part of them, or numbers."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import BeforeValidator, Field

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.constraints.limits.numbers_by_joint import Positives, by_dof
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import ArrayField, Positive
from hsp_control.robot import Robot


class Factors(Mapping[str, float]):
    """Factors by joint name; they never change."""

    def __init__(self, factors: Mapping[str, float]) -> None:
        """Copy the factors."""
        self._factors = dict(factors)

    def __getitem__(self, joint: str) -> float:
        return self._factors[joint]

    def __iter__(self) -> Iterator[str]:
        return iter(self._factors)

    def __len__(self) -> int:
        return len(self._factors)

    def __hash__(self) -> int:
        return hash(frozenset(self._factors.items()))

    def __repr__(self) -> str:
        return repr(self._factors)


def _stored(scale: Any) -> Any:
    return Factors(scale) if isinstance(scale, Mapping) else scale


class Scaled(Part, error=LimitError):
    """The robot's own limit, multiplied by a factor."""

    scale: Annotated[
        float | Mapping[str, float],
        ArrayField(
            Positive | Annotated[dict[str, Positive], Field(min_length=1)], _stored
        ),
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


def none_for_nothing(value: Any) -> Any:
    """Return "none" for None: both say that there is no limit."""
    return "none" if value is None else value


Maximum: TypeAlias = Annotated[
    Literal["robot", "none"] | Scaled | Positives | None,
    BeforeValidator(none_for_nothing),
]
"""The robot's own limit, none (or None), the robot's own scaled, or numbers."""


def maximum(value: Maximum, own: Array, robot: Robot) -> Array:
    """Return a maximum effort or speed, shape (nv,); inf where there is none.

    Args:
        value: The maximum.
        own: The robot's own, as in its model, shape (nv,).
        robot: The robot.

    Raises:
        LimitError: If it does not fit the robot.
        JointNotFoundError: If a joint does not exist.
    """
    if isinstance(value, Scaled):
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
