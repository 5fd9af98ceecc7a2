"""The feedback of a task, Kv e' + Kp s(e) + offset, and the bounds of s(e)."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, BeforeValidator

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError, TaskError
from hsp_control.declaration.quantities import Positive, plain
from hsp_control.edge.threshold import WHOLE
from hsp_control.robot import Robot

UNBOUNDED = np.zeros((0, 3))
"""No part of the error is bounded: see `Feedback.largest`."""


class Feedback(NamedTuple):
    """Kv e' + Kp s(e) + offset: a task's feedback, as one argument of a call.

    s(e) is e with its parts, such as the position, shortened to their largest lengths:
    s(e) = e if no part is longer.

    The controller owns these arrays and changes them in place: gains by events, the
    offset by compensators such as integral action.
    """

    Kp: Array  # position gain, shape (m, m) [1/s²]
    Kv: Array  # velocity gain, shape (m, m) [1/s]
    # additional term of the error equation, shape (m,) [m/s² or rad/s²]; zero unless a
    # compensator writes it
    offset: Array
    # of each part of e that is bounded: its first row, the row after its last, and its
    # largest length, shape (parts, 3) [-, -, m or rad]
    largest: Array = UNBOUNDED

    def acceleration(self, e: Array, e_dot: Array) -> Array:
        """Return Kv e' + Kp s(e) + offset, shape (m,), for a task in plain Python."""
        own = Feedback(*map(_packed, self))
        out = np.zeros(len(self.offset))
        engine.FeedbackAcceleration(
            feedback=own, e=_packed(e), e_dot=_packed(e_dot), out=out
        )()
        return out


def _packed(x: ArrayLike) -> Array:
    return np.ascontiguousarray(x, dtype=float)


class FeedbackInForce(NamedTuple):
    """The arrays of a task's feedback while it runs; the controller owns them."""

    # Parameters that change at run time: Kp and Kv, (2, m, m), or those of another kind
    # of feedback.
    numbers: Array
    feedback: Feedback  # read by the task
    # Λ⁻¹ in the coordinates of the error, (m, m), of the last step; only of a task with
    # an impedance.
    mobility: Array


class ErrorPart(NamedTuple):
    """Some consecutive components of a task's error that share a unit.

    Attributes:
        name: Their name, such as ``position``.
        unit: Their unit, such as ``m``.
        rate_unit: The unit of their rates, such as ``m/s``.
        size: Their number.
    """

    name: str
    unit: str
    rate_unit: str
    size: int

    @property
    def yields(self) -> float:
        """The factor of L for it; see `hsp_control.edge.threshold`."""
        return 1.0 if self.unit == "rad" else max(WHOLE + 1.0 - self.size, 1.0)


LargestError = Annotated[
    Literal["robot", "none"] | Positive | Sequence[Positive | None] | None,
    BeforeValidator(plain),
    AfterValidator(lambda given: tuple(given) if isinstance(given, list) else given),
]
"""The robot's own, none, one number, or one per part of the error."""


def largest_errors(
    declared: Any, parts: Sequence[ErrorPart], robot: Robot
) -> Sequence[float | None] | str:
    """Return the largest error of each part, None for no bound; or "none" for all."""
    length, angle = robot.largest_error
    own = {"m": length, "rad": angle, "-": angle}
    return each_part(declared, parts, own, TaskError)


def each_part(
    declared: Any,
    parts: Sequence[ErrorPart],
    own: Mapping[str, float],
    error: type[HspControlError],
) -> Sequence[float | None] | str:
    """Return a bound per part of an error, None for no bound; or "none" for all.

    ``own`` has the robot's bounds by the unit of the error, inf for no bound.
    """
    if declared == "none" or declared is None:
        return "none"
    if declared == "robot":
        found = [own.get(each.unit, np.inf) for each in parts]
    else:
        several = isinstance(declared, tuple)
        found = [*declared] if several else [declared] * len(parts)
        if len(found) != len(parts):
            names = " and ".join(f"{each.name} [{each.unit}]" for each in parts)
            raise error(
                f"has {len(found)} numbers; needs one for each part of the error: "
                f"{names}"
            )
    return tuple(
        None if each is None or np.isinf(each) else float(each) for each in found
    )


def beyond_largest(e: Array, largest: Array) -> float:
    """Return the length of the longest part of an error beyond its largest, or 0."""
    found = 0.0
    for first, end, longest in largest.tolist():
        away = float(np.linalg.norm(e[int(first) : int(end)]))
        if away > max(longest, found):
            found = away
    return found
