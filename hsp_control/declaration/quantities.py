"""The types of fields: numbers with bounds, and arrays with shapes.

An array may be given as a list, a tuple or any NumPy array of numbers; it is stored as
a read-only copy of doubles.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    GetCoreSchemaHandler,
    Strict,
    WithJsonSchema,
)
from pydantic_core import CoreSchema, core_schema

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ImmutableError


def plain(value: Any) -> Any:
    """Return NumPy's numbers and arrays as Python's numbers and lists, others as is."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple) and any(
        isinstance(each, np.generic | np.ndarray | tuple) for each in value
    ):
        return [plain(each) for each in value]
    return value


LARGEST = 1e30
"""Bound on lengths, times, masses and gains in any unit: products of some such numbers,
and of inverses of positive ones, do not overflow."""


def _not_huge(value: float) -> float:
    if abs(value) > LARGEST:
        raise ValueError(
            f"{value:g} is absurdly large; its size must be {LARGEST:g} at most"
        )
    return value


def _not_tiny(value: float) -> float:
    if value < 1.0 / LARGEST:
        raise ValueError(
            f"{value:g} is absurdly small; must be {1.0 / LARGEST:g} at least"
        )
    return value


_PLAIN = BeforeValidator(plain)
_SIZE = AfterValidator(_not_huge)
_LEAST = AfterValidator(_not_tiny)
Number = Annotated[float, Strict(), Field(allow_inf_nan=False), _PLAIN, _SIZE]
Positive = Annotated[
    float, Strict(), Field(gt=0.0, allow_inf_nan=False), _PLAIN, _SIZE, _LEAST
]
NonNegative = Annotated[
    float, Strict(), Field(ge=0.0, allow_inf_nan=False), _PLAIN, _SIZE
]
Share = Annotated[float, Strict(), Field(ge=0.0, lt=1.0, allow_inf_nan=False), _PLAIN]
"""0 ≤ x < 1."""
Fraction = Annotated[
    float, Strict(), Field(gt=0.0, le=1.0, allow_inf_nan=False), _PLAIN
]
"""0 < x ≤ 1."""
ProperFraction = Annotated[
    float, Strict(), Field(gt=0.0, lt=1.0, allow_inf_nan=False), _PLAIN
]
"""0 < x < 1."""
Count = Annotated[int, Strict(), Field(ge=0), _PLAIN]
PositiveCount = Annotated[int, Strict(), Field(ge=1), _PLAIN]
Flag = Annotated[bool, Strict()]
Name = Annotated[
    str, Strict(), Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f]*$")
]
"""The name that a user gives a part, in messages and in columns of the log."""
FileName = Annotated[
    str | Path, AfterValidator(str), WithJsonSchema({"type": "string"})
]
"""The path of a file, stored as text."""
Names = Annotated[Sequence[str], AfterValidator(tuple)]
"""Names, stored as a tuple."""


def _distinct_axes(letters: str) -> str:
    if not letters or len(set(letters)) < len(letters) or set(letters) - set("xyz"):
        raise ValueError(f"{letters!r} must be distinct letters of x, y and z")
    return letters


class ReadOnlyDict(dict[Any, Any]):
    """A mapping that cannot be changed."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        """Raise: a value does not change."""
        raise ImmutableError("the mappings of a part cannot be changed")

    __setitem__ = __delitem__ = _refuse
    clear = pop = popitem = setdefault = update = __ior__ = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return ReadOnlyDict, (dict(self),)


READ_ONLY = AfterValidator(ReadOnlyDict)
"""For a field that holds a mapping."""
Axes = Annotated[str, AfterValidator(_distinct_axes)]
"""World axes by their letters, such as ``xz``."""


class ArrayField:
    """The validation of a field that holds an array, or the result of a list."""

    def __init__(
        self, items: Any, convert: Callable[[Any], object], none: str | None = None
    ) -> None:
        # checked by pydantic first, such as nested lists of numbers
        self.items = items
        self.convert = convert  # makes the array of them, and may check more
        self.none = none  # the form of None in plain data

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_before_validator_function(
            plain,
            core_schema.no_info_after_validator_function(
                self.convert, handler.generate_schema(self.items)
            ),
            serialization=core_schema.plain_serializer_function_ser_schema(plain),
        )


class OrInstance(ArrayField):
    """The validation of a field: its form in YAML, or in Python an instance of a class.

    As an annotation: ``Annotated[str | Obstacle, OrInstance(Name, Obstacle)]``. Schemas
    and messages mention only the form in YAML.
    """

    def __init__(self, items: Any, instance_of: type) -> None:
        super().__init__(items, lambda value: value)
        self.instance_of = instance_of  # the class

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(
            lambda value, check: (
                value if isinstance(value, self.instance_of) else check(value)
            ),
            handler.generate_schema(self.items),
        )


def numbers(value: object) -> Array | None:
    """Return an array of numbers that a list, a tuple or an array is; None: it is not.

    A part that a bare value means begins with it; see `Declared.of_value`.
    """
    if not isinstance(value, list | tuple | np.ndarray):
        return None
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        return None
    return array.astype(float) if array.dtype.kind in "fiu" else None


def read_only(value: Any) -> Array:
    """Return a read-only copy, as doubles."""
    if isinstance(value, list):
        sizes = {len(row) for row in value if isinstance(row, list)}
        if len(sizes) > 1:
            raise ValueError(
                f"rows have different lengths {sorted(sizes)}; need the same"
            )
    try:
        array = np.array(value, dtype=float)
    except ValueError:  # further inside
        raise ValueError("rows have different lengths; need the same") from None
    array.setflags(write=False)
    return array


_Row = Annotated[list[Number], Field(min_length=1)]
_Rows = Annotated[list[_Row], Field(min_length=1)]
_Row3 = Annotated[list[Number], Field(min_length=3, max_length=3)]
_Positive2 = Annotated[list[Positive], Field(min_length=2, max_length=2)]
_Positive3 = Annotated[list[Positive], Field(min_length=3, max_length=3)]
_Row2OrMore = Annotated[list[Number], Field(min_length=2)]

Vector = Annotated[ArrayLike, ArrayField(_Row, read_only)]
"""Shape (n,)."""
Vector3 = Annotated[ArrayLike, ArrayField(_Row3, read_only)]
"""Shape (3,)."""
PositiveVector2 = Annotated[ArrayLike, ArrayField(_Positive2, read_only)]
"""Two positive numbers."""
PositiveVector3 = Annotated[ArrayLike, ArrayField(_Positive3, read_only)]
"""Three positive numbers."""
Points = Annotated[
    ArrayLike, ArrayField(Annotated[list[_Row3], Field(min_length=1)], read_only)
]
"""Shape (k, 3)."""
Grid = Annotated[
    ArrayLike, ArrayField(Annotated[list[_Row2OrMore], Field(min_length=2)], read_only)
]
"""Shape (m, n), both at least 2."""
Matrix = Annotated[ArrayLike, ArrayField(_Rows, read_only)]
"""Shape (m, n)."""
Tensor = Annotated[
    ArrayLike, ArrayField(Annotated[list[_Rows], Field(min_length=1)], read_only)
]
"""Shape (k, m, n)."""
Gain = Annotated[
    ArrayLike, ArrayField(Positive | list[Positive] | list[list[Number]], read_only)
]
"""A number, one number per row, or a matrix."""
Semidefinite = Annotated[
    ArrayLike,
    ArrayField(NonNegative | list[NonNegative] | list[list[Number]], read_only),
]
"""A number, one number per row, or a matrix: no eigenvalue is negative."""
PositiveNumbers = Annotated[ArrayLike, ArrayField(Positive | list[Positive], read_only)]
"""One positive number, or one per coordinate."""
Weights = Annotated[ArrayLike, ArrayField(NonNegative | list[NonNegative], read_only)]
"""One number, or one per joint."""
Periods = Annotated[int, Strict(), Field(ge=0, le=100_000), _PLAIN]
"""A number of control periods."""
