"""Unknown keyword arguments of public functions: refused with the nearest name."""

from collections.abc import Callable
from functools import wraps
from inspect import Parameter, signature
from typing import ParamSpec, TypeVar

from hsp_control.common.suggestions import did_you_mean, listing

_Given = ParamSpec("_Given")
_Result = TypeVar("_Result")


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
        what = function.__qualname__
        if function.__name__ == "__init__":  # perhaps of a base
            what = type(args[0]).__name__
        for name in given:
            if name not in names:
                raise TypeError(
                    f"{what}: unknown argument {name!r}{did_you_mean(name, names)} "
                    f"(allowed: {listing(names, limit=20)})"
                )
        try:
            takes.bind(*args, **given)
        except TypeError as error:
            raise TypeError(f"{what}: {error} (arguments: {listing(names)})") from None
        return function(*args, **given)

    return called
