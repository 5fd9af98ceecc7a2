"""A smooth change from one field to another, with its exact rate."""

from hsp_control.null_space.fields.field import NullSpaceField, WeightedSum
from hsp_control.null_space.fields.weight import Ramp


def crossfade(
    before: NullSpaceField, after: NullSpaceField, *, start: float, duration: float
) -> WeightedSum:
    """Return the field g = (1 - s) g0 + s g1, with s(t) from 0 to 1, C² in t.

    Its rate is g' = (1 - s) g0' + s g1' + s' (g1 - g0): a sum with ramped weights.

    Args:
        before: g0.
        after: g1.
        start: Start of the change [s].
        duration: Duration of the change > 0 [s].

    Raises:
        FieldError: If the duration is not positive, the fields belong to different
            robots, or one of them is `Uncontrolled`.
    """
    return WeightedSum(
        [
            (Ramp(1.0, 0.0, start=start, duration=duration), before),
            (Ramp(0.0, 1.0, start=start, duration=duration), after),
        ]
    )
