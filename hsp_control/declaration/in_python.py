"""Arguments in Python: bare values that mean a part."""

from collections.abc import Mapping, Sequence
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from hsp_control.declaration.any_of import AnyOf
from hsp_control.declaration.families import Declared, value_fields
from hsp_control.declaration.language import meant


def with_parts_made(
    cls: Any, args: Sequence[Any], kwargs: Mapping[str, Any]
) -> tuple[Sequence[Any], Mapping[str, Any]]:
    """Return arguments in which bare values are the parts that they mean.

    ``FramePose("hand", pin.SE3(...))`` holds a pose; see `Declared.of_value`.
    """
    held = _held(cls)
    if not held:
        return args, kwargs
    names = [field.name for field in value_fields(cls) if not field.kw_only]
    made = {key: meant(value, held.get(key, ())) for key, value in kwargs.items()}
    positional = [
        meant(value, held.get(name, ()))
        for name, value in zip(names, args, strict=False)
    ]
    return [*positional, *args[len(names) :]], made


@cache
def _held(cls: Any) -> dict[str, tuple[type[Declared], ...]]:
    """Return the families of the fields that hold one part, by the field's name."""
    fields: Mapping[str, Any] = getattr(cls, "__pydantic_fields__", {})
    found = {
        name: _bases(each.annotation, each.metadata) for name, each in fields.items()
    }
    return {name: tuple(bases) for name, bases in found.items() if bases}


def _bases(annotation: Any, metadata: Sequence[Any] = ()) -> list[type[Declared]]:
    """Return the bases of the families that an annotation names outside containers."""
    for each in metadata:
        if isinstance(each, AnyOf):
            return [*each.bases]
    if get_origin(annotation) is Annotated:
        inner, *more = get_args(annotation)
        return _bases(inner, more)
    family = getattr(annotation, "family", None)
    if family is not None:
        return [annotation] if family.base is annotation else []
    if get_origin(annotation) in (Union, UnionType):
        return [base for each in get_args(annotation) for base in _bases(each)]
    return []
