"""Types as a reader writes them: a checked number is a float, whatever checks it."""

import inspect
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from sphinx.application import Sphinx


def plain(annotation: Any) -> Any:
    """Return an annotation without what only pydantic reads."""
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return plain(args[0])
    if origin in {Union, UnionType}:
        return Union[tuple(plain(each) for each in args)]  # noqa: UP007 (made at run time)
    if origin in {tuple, list, dict} and args:
        return origin[tuple(plain(each) for each in args)]
    return annotation


def make_plain(value: type) -> None:
    """Replace the annotations of a declared part, as long as documents are built."""
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


def setup(app: Sphinx) -> dict[str, bool]:
    """Nothing to register: `reference` calls `make_plain`."""
    return {"parallel_read_safe": True}
