"""The base class of the models of a configuration."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from hsp_control.declaration.equality import same

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Vector = list[Number]
Vector3 = Annotated[list[Number], Field(min_length=3, max_length=3)]
Gain = Positive | Annotated[list[Positive], Field(min_length=1)] | list[Vector]
Name = Annotated[
    str, Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f]*$")
]
"""The user's name for a part of the configuration; log columns contain it."""
Weights = NonNegative | list[NonNegative]


class Model(BaseModel):
    """A part of the schema: unknown keys are errors, values never change."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, use_attribute_docstrings=True
    )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Model) or type(self) is not type(other):
            return NotImplemented
        names = type(self).model_fields  # some are arrays
        return all(same(getattr(self, name), getattr(other, name)) for name in names)
