"""A smooth change from one field to another, with its exact rate."""

from hsp_control.null_space.fields.field import FieldSum, NullSpaceField
from hsp_control.null_space.fields.weight import Ramp


def crossfade(
    before: NullSpaceField, after: NullSpaceField, *, start: float, duration: float
) -> FieldSum:
    """Return the field g = (1 - s) g0 + s g1, with s(t) from 0 to 1, C² in t.

    Its rate is g' = (1 - s) g0' + s g1' + s' (g1 - g0): a sum with ramped weights, with
    the terms of ``before`` first.

    Args:
        before: g0.
        after: g1.
        start: Start of the change [s].
        duration: Duration of the change > 0 [s].

    Raises:
        FieldError: If the duration is not positive, or a field is `Uncontrolled`.
    """
    fading = Ramp(initial=1.0, final=0.0, start=start, duration=duration)
    rising = Ramp(initial=0.0, final=1.0, start=start, duration=duration)
    return fading * before + rising * after
