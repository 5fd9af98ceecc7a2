"""From one field to another, with the exact rate of what is in between."""

from hsp_control.null_space.fields.field import NullSpaceField, WeightedSum
from hsp_control.null_space.fields.weight import Ramp


def crossfade(
    before: NullSpaceField, after: NullSpaceField, *, start: float, duration: float
) -> WeightedSum:
    """Return g = (1 - s) g0 + s g1, with s(t) from 0 to 1, twice differentiable.

    Its rate is g' = (1 - s) g0' + s g1' + s' (g1 - g0): a sum with ramped weights.

    Args:
        before: g0.
        after: g1.
        start: When s begins to rise [s].
        duration: How long that takes [s].

    Raises:
        FieldError: If the duration is not positive, the fields are of different robots,
            or one of them leaves the null space uncontrolled.
    """
    return WeightedSum(
        [
            (Ramp(1.0, 0.0, start=start, duration=duration), before),
            (Ramp(0.0, 1.0, start=start, duration=duration), after),
        ]
    )
