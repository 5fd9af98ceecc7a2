"""What a configuration says about the null space: fields, metric and gain."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import AfterValidator

from hsp_control.common.exceptions import FieldError
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import Gain, Positive
from hsp_control.null_space.fields import FieldSum, NullSpaceField
from hsp_control.null_space.metrics import Metric


def _summable(fields: Sequence[NullSpaceField]) -> tuple[NullSpaceField, ...]:
    """Return the fields in a tuple."""
    for k, field in enumerate(fields):
        if len(fields) > 1 and not field.controls:
            with within(k):
                raise FieldError(f"{field.name!r} cannot be combined with other fields")
    return tuple(fields)


class NullSpaceSettings(Part, error=FieldError):
    """The control of self-motion."""

    gain: Gain = 10.0
    """Null-space gain K_N [1/s], the rate at which the null-space error decays: a
    number, nv numbers, or a matrix; over a metric that changes with q, one number."""
    metric: Metric | None = None
    """The joint-space metric W [-]; by default the identity, or the mass matrix if a
    task has an impedance."""
    fields: Annotated[Sequence[NullSpaceField], AfterValidator(_summable)] = ()
    """Fields [rad/s or m/s]; their sum is used. Without fields, self-motion comes to
    rest."""
    singularity_threshold: Positive = 0.03
    """Singular value of the task Jacobian below which its pseudo-inverse is damped
    [-]."""

    @property
    def field(self) -> NullSpaceField | None:
        """The sum of the fields; None if there are none."""
        if len(self.fields) == 1:
            return self.fields[0]
        return FieldSum(self.fields) if self.fields else None
