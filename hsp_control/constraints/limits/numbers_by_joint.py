"""Limits in numbers: one for all degrees of freedom, one for each, or by joint name."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BeforeValidator, Field

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError, LimitError
from hsp_control.declaration.quantities import ArrayField, Number, Positive, plain

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
    """Return one number or nv as an array (nv,); ``none`` is what None stands for."""
    array = np.array(numbers, dtype=float)  # None becomes NaN
    array[np.isnan(array)] = none
    if array.ndim and array.shape != (nv,):
        raise error(f"has {len(array)} numbers; needs one number or {nv}")
    return np.full(nv, array)


class OfJoints(Mapping[str, T]):
    """Values by joint name; they never change."""

    def __init__(self, values: Mapping[str, T]) -> None:
        """Copy the values."""
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
