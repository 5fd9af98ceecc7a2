"""Limits in numbers: one number for all degrees of freedom, or one for each."""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BeforeValidator, Field

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError, LimitError
from hsp_control.declaration.quantities import ArrayField, Number, Positive, plain


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
    """Return numbers as an array of shape (nv,).

    Args:
        numbers: One number, or nv numbers.
        nv: The robot's degrees of freedom.
        none: What None stands for.
        error: What is raised.

    Raises:
        HspControlError: If there are neither one nor nv numbers.
    """
    array = np.array(numbers, dtype=float)  # None becomes NaN
    array[np.isnan(array)] = none
    if array.ndim and array.shape != (nv,):
        raise error(f"has {len(array)} numbers; needs one number or {nv}")
    return np.full(nv, array)
