"""Something that is made for certain objects, and kept until others come."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

Made = TypeVar("Made")

_NONE_YET = object()


class IdentityCache(Generic[Made]):
    """The result of a function for its last arguments, compared by identity.

    What is compiled for a state or an array reads and writes that very memory, so an
    equal one will not do. A copy or a pickle makes it anew, for the copied objects.
    """

    __slots__ = ("_fifth", "_first", "_fourth", "_made", "_make", "_second", "_third")

    def __init__(self, make: Callable[..., Made]) -> None:
        self._make = make
        self._first: Any = _NONE_YET
        self._second: Any = None
        self._third: Any = None
        self._fourth: Any = None
        self._fifth: Any = None
        self._made: Any = None

    def get(
        self,
        first: Any,
        second: Any = None,
        third: Any = None,
        fourth: Any = None,
        fifth: Any = None,
    ) -> Made:
        """Return the result, made anew if any argument is another object."""
        # Spelled out, and no `__call__`: so it costs as little as without a class.
        if (
            first is not self._first
            or second is not self._second
            or third is not self._third
            or fourth is not self._fourth
            or fifth is not self._fifth
        ):
            keys = (first, second, third, fourth, fifth)
            self._made = self._make(*(key for key in keys if key is not None))
            self._first, self._second, self._third = first, second, third
            self._fourth, self._fifth = fourth, fifth
        made: Made = self._made
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return IdentityCache, (self._make,)
