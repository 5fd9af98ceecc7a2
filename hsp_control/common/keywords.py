"""Unknown keyword arguments of public functions: refused with the nearest name."""

from collections.abc import Callable
from functools import wraps
from inspect import Parameter, isfunction, signature
from typing import ParamSpec, TypeVar

from hsp_control.common.suggestions import did_you_mean, listing

_Given = ParamSpec("_Given")
_Result = TypeVar("_Result")
_Kind = TypeVar("_Kind")


def suggesting(function: Callable[_Given, _Result]) -> Callable[_Given, _Result]:
    """Let a function, or a class's ``__init__``, suggest the argument that was meant.

    As the arguments of parts do; Python itself names only the wrong one, in a
    TypeError, which this is as well. A function that takes any keyword checks its own.
    """
    named = Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY
    takes = signature(function)
    names = [
        each.name
        for each in takes.parameters.values()
        if each.kind in named and each.name not in {"self", "cls"}
    ]

    @wraps(function)
    def called(*args: _Given.args, **given: _Given.kwargs) -> _Result:
        try:
            return function(*args, **given)
        except TypeError:  # perhaps of the call itself
            check(*args, **given)
            raise

    def check(*args: _Given.args, **given: _Given.kwargs) -> None:
        what = function.__qualname__
        if function.__name__ == "__init__":  # perhaps of a base
            what = type(args[0]).__name__
        for name in given:
            if name not in names:
                raise TypeError(
                    f"{what}: unknown argument {name!r}{did_you_mean(name, names)} "
                    f"(allowed: {listing(names, limit=20)})"
                ) from None
        try:
            takes.bind(*args, **given)
        except TypeError as error:
            raise TypeError(f"{what}: {error} (arguments: {listing(names)})") from None

    return called


def suggesting_methods(cls: type[_Kind]) -> type[_Kind]:
    """Let all public methods of a class suggest the argument that was meant."""
    for name, value in list(vars(cls).items()):
        if isfunction(value) and not name.startswith("_"):
            setattr(cls, name, suggesting(value))
    return cls
