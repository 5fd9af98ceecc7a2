"""Arguments in Python: bare values that mean a part, and messages that name classes."""

from collections.abc import Mapping, Sequence
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from hsp_control.common.exceptions import HspControlError
from hsp_control.common.suggestions import nearest
from hsp_control.declaration.any_of import AnyOf
from hsp_control.declaration.families import Declared, Family, value_fields
from hsp_control.declaration.plain import joined, shortened

_NAMESPACES = {
    "distances": "limits",
    "drives": "plants",
    "estimators": "estimation",
    "orientations": "trajectories",
    "poses": "trajectories",
    "sensors": "plants",
}
"""The public namespace of a family, where it is not called as the family is."""


def check_kind(
    what: str, value: object, kind: type[Any], error: type[HspControlError]
) -> None:
    """Check that an argument is an instance of a class; ``what`` begins the message."""
    if not isinstance(value, kind):
        raise error(f"{what} {misfit(value, [kind])}")


def misfit(value: object, kinds: Sequence[type[Any]]) -> str:
    """Return what is wrong with a value that is an instance of none of some classes."""
    given = shortened(repr(value).partition("\n")[0], 60)
    if isinstance(value, type):
        return f"{value.__name__}, a class; give an instance, {value.__name__}(...)"
    needed = joined([_with_article(kind.__name__) for kind in kinds])
    families = [each for kind in kinds if (each := getattr(kind, "family", None))]
    hint = ""
    if families:
        places = dict.fromkeys(map(_namespace, families))
        hint = f", one of {joined([*places])}"
    for family in families:
        if isinstance(value, str) and (near := nearest(value, family.members)):
            name = f"{_namespace(family)}.{family.members[near].__name__}"
            hint = f"; did you mean {name}(...)?"
    return f"{given}, of type {type(value).__name__}; needs {needed}{hint}"


def _with_article(name: str) -> str:
    return f"{'an' if name[0] in 'AEIO' else 'a'} {name}"


def _namespace(family: Family) -> str:
    return f"hsp.{_NAMESPACES.get(family.name, family.name)}"


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
    made = {
        key: _made(value, held[key]) if key in held else value
        for key, value in kwargs.items()
    }
    positional = [
        _made(value, held[name]) if name in held else value
        for name, value in zip(names, args, strict=False)
    ]
    return [*positional, *args[len(names) :]], made


def _made(value: Any, bases: Sequence[type[Declared]]) -> Any:
    if value is None or isinstance(value, Declared | Mapping | str):
        return value
    for base in bases:
        assert base.family is not None
        for member in base.family.members.values():
            if (found := member.of_value(value)) is not None:
                return found
    return value


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
