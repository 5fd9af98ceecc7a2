"""Types as a reader writes them: a checked number is a float, whatever checks it."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from types import FunctionType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from numpy import ndarray, typing
from sphinx.application import Sphinx


class ArrayLike:
    """Stands for NumPy's type of this name, which is a union of seven others."""


def plain(annotation: Any) -> Any:
    """Return an annotation without metadata for pydantic."""
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return plain(args[0])
    if origin is ndarray:
        return ndarray
    if origin in {Union, UnionType}:
        if set(args) >= _ARRAY_LIKE:
            args = (ArrayLike, *(each for each in args if each not in _ARRAY_LIKE))
        return Union[tuple(plain(each) for each in args)]  # noqa: UP007 (made at run time)
    if isinstance(annotation, list):  # arguments of a function
        return [plain(each) for each in annotation]
    if origin in {tuple, list, dict, Mapping, Sequence, Callable} and args:
        return origin[tuple(plain(each) for each in args)]
    return annotation


_ARRAY_LIKE = set(get_args(typing.ArrayLike))


def make_plain(value: Any) -> None:
    """Replace the annotations of a class or function while documents are built."""
    for each in (value, *_members(value)):
        if isinstance(each, FunctionType):
            found = each.__annotations__.items()
            each.__annotations__ = {name: plain(given) for name, given in found}
    if not hasattr(value, "__pydantic_fields__"):
        return
    hints = get_type_hints(value, include_extras=True)
    value.__annotations__ = {
        name: plain(hints.get(name, given))
        for name, given in vars(value).get("__annotations__", {}).items()
    }
    signature = inspect.signature(value)
    parameters = [
        each.replace(annotation=plain(hints.get(name, each.annotation)))
        for name, each in signature.parameters.items()
    ]
    value.__signature__ = signature.replace(
        parameters=parameters, return_annotation=inspect.Signature.empty
    )  # type: ignore[attr-defined]
    value.__doc__ = getattr(
        value, "_docstring", value.__doc__
    )  # each field is an attribute, with its own


def _members(value: Any) -> list[Any]:
    """Return the functions, getters and constructors of a class and of its bases."""
    members = [m for base in getattr(value, "__mro__", ()) for m in vars(base).values()]
    return [getattr(m, "fget", None) or getattr(m, "__func__", m) for m in members]


def setup(app: Sphinx) -> dict[str, bool]:
    """Nothing to register: `reference` calls `make_plain`."""
    return {"parallel_read_safe": True}
