"""Something that is made for certain objects, and kept until others come."""

from collections.abc import Callable
from operator import is_
from typing import Any, Generic, TypeVar

Made = TypeVar("Made")

_NONE_YET = object()


class IdentityCache(Generic[Made]):
    """The result of a function for its last arguments, compared by identity.

    What is compiled for a state or an array reads and writes that very memory, so an
    equal one will not do. A copy or a pickle makes it anew, for the copied objects.
    """

    __slots__ = ("_first", "_made", "_make", "_rest", "_second", "_third")

    def __init__(self, make: Callable[..., Made]) -> None:
        """Keep the function, which makes the result of the arguments."""
        self._make = make
        self._first: Any = _NONE_YET
        self._second: Any = None
        self._third: Any = None
        self._rest: tuple[Any, ...] = ()
        self._made: Any = None

    def __call__(
        self, first: Any, second: Any = None, third: Any = None, *rest: Any
    ) -> Made:
        """Return the result, made anew if any argument is another object."""
        # Spelled out: this runs in every step, and a loop would take 0.3 µs more.
        if (
            first is not self._first
            or second is not self._second
            or third is not self._third
            or (rest and not all(map(is_, rest, self._rest)))
        ):
            keys = (first, second, third, *rest)
            self._made = self._make(*(key for key in keys if key is not None))
            self._first, self._second, self._third, *_ = keys
            self._rest = rest
        made: Made = self._made
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        return IdentityCache, (self._make,)
