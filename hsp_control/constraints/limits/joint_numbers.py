"""Numbers by joint, maxima and ranges of positions."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BeforeValidator, Field

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError, LimitError
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import ArrayField, Number, Positive, plain
from hsp_control.robot import Robot

T = TypeVar("T")


def _without_infinity(value: Any) -> Any:
    """Return a plain list with None for ±inf; other values as they are."""
    value = plain(value)
    if not isinstance(value, list | tuple):
        return value
    return [
        None if isinstance(each, float) and abs(each) == np.inf else each
        for each in value
    ]


def _stored(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


Positives = Annotated[
    ArrayLike | Sequence[float | None],
    ArrayField(
        Annotated[
            Positive | Annotated[list[Positive | None], Field(min_length=1)],
            BeforeValidator(_without_infinity),
        ],
        _stored,
    ),
]
"""A positive number, or nv of them in a tuple; ±inf is stored as None: no limit."""
Numbers = Annotated[
    ArrayLike | Sequence[float | None],
    ArrayField(
        Annotated[
            Number | Annotated[list[Number | None], Field(min_length=1)],
            BeforeValidator(_without_infinity),
        ],
        _stored,
    ),
]
"""A number, or nv of them in a tuple; ±inf is stored as None: no limit."""


def by_dof(
    numbers: Any,
    nv: int,
    none: float = np.inf,
    error: type[HspControlError] = LimitError,
) -> Array:
    """Return one number or nv as an array (nv,); ``none`` replaces None."""
    array = np.array(numbers, dtype=float)  # None becomes NaN
    array[np.isnan(array)] = none
    if array.ndim and array.shape != (nv,):
        raise error(f"has {len(array)} numbers; needs one number or {nv}")
    return np.full(nv, array)


class OfJoints(Mapping[str, T]):
    """Values by joint name; they never change."""

    def __init__(self, values: Mapping[str, T]) -> None:
        self._values = dict(values)

    def __getitem__(self, joint: str) -> T:
        return self._values[joint]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __hash__(self) -> int:
        return hash(frozenset(self._values.items()))

    def __repr__(self) -> str:
        return repr(self._values)


def of_joints(value: Any) -> Any:
    """Return a mapping as one that never changes; other values as they are."""
    return OfJoints(value) if isinstance(value, Mapping) else value


_PositiveOfJoints = Annotated[dict[str, Positive], Field(min_length=1)]


class Scaled(Part, error=LimitError):
    """The robot's own limit, multiplied by a factor."""

    scale: Annotated[
        float | Mapping[str, float], ArrayField(Positive | _PositiveOfJoints, of_joints)
    ]
    """The factor [-]; 0.5 halves the limit. Or factors by joint name; the other joints
    keep their own limits."""

    def of(self, own: Array, robot: Robot) -> Array:
        """Return the robot's own limit, scaled, shape (nv,)."""
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
        """Return the robot's own limit with these numbers, shape (nv,)."""
        limit = own.copy()
        for joint, number in self.joints.items():
            with within("joints", joint):
                dofs = robot.velocity_index(joint)
                if dofs.start in robot.unactuated:
                    raise LimitError(f"no motor moves {joint}")
                limit[dofs] = number
        return limit


def none_for_nothing(value: Any) -> Any:
    """Return "none" for None: both mean no limit."""
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
        return value.of(own_maximum(own, robot), robot)
    if isinstance(value, str):
        if value == "none":
            return np.full(robot.nv, np.inf)
        return own_maximum(own, robot)
    return by_dof(value, robot.nv)


def own_maximum(own: Array, robot: Robot) -> Array:
    """Return a URDF's maxima (nv,), inf where it has none: 0, or the largest float."""
    limit = np.array(own, dtype=float)
    limit[list(robot.unactuated)] = np.inf
    limit[(limit <= 0.0) | (limit >= np.finfo(np.float32).max)] = np.inf
    return limit


def own_speeds(robot: Robot) -> Array:
    """Return a URDF's largest speeds (nv,), inf where it has none.

    A joint without one has the largest of the others of its unit: otherwise it would
    compensate for their limits at any speed.
    """
    speeds = own_maximum(robot.model.velocityLimit, robot)
    for unit in ("rad", "m"):
        same = [i for i, *_ in robot.single_dof_joints if robot.units[i] == unit]
        known = speeds[same][np.isfinite(speeds[same])]
        speeds[same] = np.minimum(speeds[same], known.max(initial=0.0) or np.inf)
    return speeds


class PositionRange(Part, error=LimitError):
    """Joint position limits in numbers.

    Joints with more than one coordinate (roots, continuous joints) can have none.
    """

    lower: Numbers
    """Lower joint position limits, one number or nv, None for no limit [rad or m]."""
    upper: Numbers
    """Upper joint position limits, one number or nv, None for no limit [rad or m]."""

    def __post_init__(self) -> None:
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
        """Return lower and upper limits, shape (nv,); ±inf where there is none."""
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
        for joint, (lower, upper) in self.joints.items():
            if lower >= upper:
                raise LimitError(
                    f"joints.{joint}: lower must be below upper; got {lower}, {upper}"
                )

    def of(self, robot: Robot) -> tuple[Array, Array]:
        """Return lower and upper limits, shape (nv,); ±inf where there is none."""
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
