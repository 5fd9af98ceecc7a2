"""What Python shows of a part: a signature of plain types, its fields' docstrings."""

from dataclasses import MISSING, Field
from inspect import Parameter, Signature
from textwrap import fill
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from numpy.typing import ArrayLike

from hsp_control.declaration.families import Declared, value_fields


class PlainSignature:
    """The signature of a class, without what only pydantic reads in its annotations."""

    def __get__(self, instance: object, cls: type[Declared]) -> Signature:
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
    """Return the fields, those that may be given by position first."""
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


_ARRAY_LIKE = set(get_args(ArrayLike))


def _words(annotation: Any) -> str:
    """Return a type as one writes it: a checked number is a float."""
    origin, args = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _words(args[0])
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
