"""Checks that methods that override others take the arguments these are called with."""

import inspect
from collections.abc import Mapping
from types import FunctionType


def check_overrides(cls: type, namespace: Mapping[str, object]) -> None:
    """Check the methods of a class body.

    Without it, a method with other arguments fails in the first step, with a message
    about a call that its author has never seen.

    Raises:
        TypeError: If one takes other positional arguments than the one it overrides.
    """
    for name, own in namespace.items():
        if not isinstance(own, FunctionType):
            continue
        above = next((base for base in cls.__mro__[1:] if name in vars(base)), None)
        if above is None:
            continue
        base = vars(above)[name]
        if isinstance(base, FunctionType) and not _takes(own, base):
            raise TypeError(
                f"{cls.__name__}.{name}{inspect.signature(own)} overrides "
                f"{above.__name__}.{name}{inspect.signature(base)}; it must take the "
                "same arguments"
            )


def _takes(own: FunctionType, base: FunctionType) -> bool:
    """Return whether a function can be called as another one, by position."""
    number, positional = base.__code__.co_argcount, own.__code__.co_argcount
    least = positional - len(own.__defaults__ or ())
    any_number = own.__code__.co_flags & inspect.CO_VARARGS
    fits = least <= number and (any_number or positional >= number)
    return bool(fits) and _required_keywords(own) <= _keywords(base)


def _keywords(function: FunctionType) -> set[str]:
    code = function.__code__
    begin = code.co_argcount
    return set(code.co_varnames[begin : begin + code.co_kwonlyargcount])


def _required_keywords(function: FunctionType) -> set[str]:
    return _keywords(function) - set(function.__kwdefaults__ or ())
