"""A part in Python: bare values that mean a part, and a signature of plain types."""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field
from functools import cache
from inspect import Parameter, Signature
from textwrap import fill
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from numpy.typing import ArrayLike

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


def plain_signature(cls: Any) -> Signature:
    """Return a class's signature, without pydantic's metadata in annotations."""
    return Signature([_parameter(each) for each in _in_order(cls)])


def with_fields(cls: type[Declared], docstring: str) -> str:
    """Return the docstring of a class with those of its fields, as its arguments."""
    lines = [
        fill(
            f"{field.name}: {cls.documentation.get(field.name, '')}",
            width=84,
            initial_indent=" " * 4,
            subsequent_indent=" " * 8,
        )
        for field in _in_order(cls)
    ]
    return "\n".join([docstring, "", "Args:", *lines] if lines else [docstring]).strip()


def _in_order(cls: type[Declared]) -> list["Field[Any]"]:
    """Return the fields, first those that may be given by position."""
    return sorted(value_fields(cls), key=lambda field: bool(field.kw_only))


def _parameter(field: "Field[Any]") -> Parameter:
    kind = Parameter.KEYWORD_ONLY if field.kw_only else Parameter.POSITIONAL_OR_KEYWORD
    default: Any = field.default
    if field.default_factory is not MISSING:
        default = field.default_factory()
    elif default is MISSING:
        default = Parameter.empty
    annotation = _Words(_words(field.type))
    return Parameter(field.name, kind, default=default, annotation=annotation)


class _Words(str):
    """An annotation in words, which a signature shows without quotes."""

    __slots__ = ()

    def __repr__(self) -> str:
        return str(self)


_ARRAY_LIKE = set(get_args(ArrayLike)) or {ArrayLike}  # since NumPy 2.5 one name


def _is_type(annotation: Any) -> bool:
    unions = Union, UnionType
    plain = isinstance(annotation, type) or get_origin(annotation) in unions
    return plain or annotation == ArrayLike


def _words(annotation: Any) -> str:
    """Return a type as one writes it: a checked number is a float."""
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        given = [each for each in args[1:] if _is_type(each)]  # see `Given`
        return _words(Union[args[0], *given])
    if origin in (Union, UnionType):
        words = ["ArrayLike"] if set(args) >= _ARRAY_LIKE else []
        rest = [each for each in args if not words or each not in _ARRAY_LIKE]
        return " | ".join(dict.fromkeys([*words, *map(_words, rest)]))
    if isinstance(annotation, list):  # the arguments of a function
        return f"[{', '.join(map(_words, annotation))}]"
    if annotation is type(None):
        return "None"
    name = getattr(origin or annotation, "__name__", str(annotation))
    if origin is None or not args:
        return str(name)
    shown = repr if origin is Literal else _words
    inside = ", ".join("..." if each is ... else shown(each) for each in args)
    return f"{name}[{inside}]"
