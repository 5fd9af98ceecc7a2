"""Attributes that cannot be assigned, and say what changes them instead."""

from collections.abc import Callable
from typing import Any, Generic, NoReturn, Self, TypeVar, overload

from hsp_control.common.exceptions import ImmutableError

Value = TypeVar("Value")


class ReadOnly(Generic[Value]):
    """A property that refuses assignment; made by the decorator `read_only`."""

    def __init__(self, get: Callable[[Any], Value], instead: str) -> None:
        """Set how to get the value, and what to do instead of assigning it."""
        self._get, self._instead = get, instead
        self.__doc__ = get.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = f"{owner.__name__}.{name}"

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type) -> Value: ...

    def __get__(self, instance: object | None, owner: type) -> Value | Self:
        return self if instance is None else self._get(instance)

    def __set__(self, instance: object, value: object) -> NoReturn:
        raise ImmutableError(f"{self._name} cannot be assigned: {self._instead}")


def read_only(
    instead: str = "build another one",
) -> Callable[[Callable[[Any], Value]], ReadOnly[Value]]:
    """Return a decorator for a read-only property."""
    return lambda get: ReadOnly(get, instead)
