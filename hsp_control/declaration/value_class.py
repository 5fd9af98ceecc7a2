"""Makes value classes of declarations: Pydantic's dataclasses, with our own errors."""

import dataclasses
import sys
from abc import ABCMeta
from collections.abc import Callable, Iterable
from functools import wraps
from inspect import Signature, cleandoc
from typing import TYPE_CHECKING, Any, NoReturn

from pydantic import ConfigDict, ValidationError
from pydantic.dataclasses import dataclass

from hsp_control.common.errors import HspControlError, ImmutableError
from hsp_control.declaration.families import Family
from hsp_control.declaration.in_python import (
    plain_signature,
    with_fields,
    with_parts_made,
)
from hsp_control.declaration.mistakes import Carrier, argument_error
from hsp_control.declaration.overrides import check_overrides

_CONFIG = ConfigDict(
    extra="forbid",
    arbitrary_types_allowed=True,
    validate_default=True,  # a default given as a tuple is stored as an array, too
    defer_build=True,  # schemas take long, and most parts are seldom used
)


class _Docstring:
    """The docstring of a class, with those of its fields."""

    def __get__(self, part: object, cls: Any) -> str:
        return with_fields(cls, cls._docstring)


class ValueClass(ABCMeta):
    """Makes parts value classes, and registers them with their families."""

    def __new__(
        mcs,
        name: str,
        bases: tuple[type, ...],
        namespace: dict[str, Any],
        /,
        *,
        family: str | None = None,
        type: str | None = None,
        error: type[HspControlError] | None = None,
        **arguments: Any,
    ) -> Any:
        """Make the class; see `Part` for the arguments."""
        cls: Any = super().__new__(mcs, name, bases, namespace, **arguments)
        if not any(isinstance(base, ValueClass) for base in bases):
            return cls  # `Part` itself
        if "__init__" in namespace:
            raise TypeError(
                f"{name} must not have __init__: declare its parameters as fields, and "
                "check them in __post_init__"
            )
        check_overrides(cls, namespace)
        if error is not None:
            cls.error = error
        if family is not None:
            cls.family = Family(family, cls)
        cls.yaml_type = type
        if "__post_init__" in namespace:
            cls.__post_init__ = _completed(cls.__post_init__)
        cls._docstring = cleandoc(namespace.get("__doc__") or "")
        hidden = _hide_properties(cls)
        # Not in __init_subclass__: ABCMeta reads all attributes then, which would build
        # pydantic's schema. Not `frozen`: that would compile two methods that ours
        # replace.
        dataclass(cls, eq=False, repr=False, config=_CONFIG)
        cls.__doc__ = _Docstring()
        for each in hidden:
            setattr(cls, each, _field_property(each))
        cls.__abstractmethods__ -= {*hidden}
        cls.__setattr__ = _refuse_assignment
        cls.__delattr__ = _refuse_deletion
        if type is not None:
            assert cls.family is not None, f"{name} has a type, but no family"
            cls.family.register(type, cls)
        return cls

    # A part's own constructor is replaced when its schema is built.
    if not TYPE_CHECKING:

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:
            """Make a part; raise its own error instead of pydantic's."""
            try:
                given, named = with_parts_made(cls, args, kwargs)
                return super().__call__(*given, **named)
            except ValidationError as error:
                raise argument_error(cls, error) from None

    @property
    def __signature__(cls) -> Signature:
        return plain_signature(cls)

    @__signature__.setter
    def __signature__(cls, value: object) -> None:
        """Ignore pydantic's, which has metadata that only pydantic reads."""


class _DocstringOfClasses:
    """The docstrings of parts where they are read as `help` does: without `__get__`."""

    def __init__(self, own: str | None) -> None:
        self._own = own

    def __get__(self, cls: type | None, _: type | None = None) -> Any:
        if cls is None:
            return self._own
        found = vars(cls).get("__doc__")
        return found.__get__(None, cls) if isinstance(found, _Docstring) else found

    def __set__(self, cls: type, value: object) -> None:
        type.__dict__["__doc__"].__set__(cls, value)


ValueClass.__doc__ = _DocstringOfClasses(ValueClass.__doc__)  # type: ignore[assignment]


def _hide_properties(cls: type) -> list[str]:
    """Return the fields without default that hide an inherited property."""
    own = vars(cls)
    hidden = [
        name
        for name in _annotated(cls)
        if name not in own and isinstance(getattr(cls, name, None), property)
    ]
    for name in hidden:
        setattr(cls, name, dataclasses.field())
    return hidden


def _annotated(cls: type) -> Iterable[str]:
    """Return the names that a class itself annotates."""
    if sys.version_info >= (3, 14):  # annotations are evaluated on request
        from annotationlib import Format, get_annotations

        return get_annotations(cls, format=Format.FORWARDREF)
    own: dict[str, Any] = vars(cls).get("__annotations__", {})
    return own


def _field_property(name: str) -> property:
    """Return the descriptor of a field, instead of the inherited property."""
    return property(
        lambda part: vars(part)[name],
        lambda part, value: vars(part).update({name: value}),
    )


def _completed(check: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return a ``__post_init__`` that sets the defaults first."""

    @wraps(check)
    def checked(self: Any) -> None:
        self._complete()
        try:
            check(self)
        except HspControlError as error:
            raise error if isinstance(error, ValueError) else Carrier(error) from None

    return checked


def _refuse_assignment(self: Any, name: str, value: object) -> NoReturn:
    """Raise: a value does not change."""
    raise ImmutableError(
        f"{type(self).__name__}.{name} cannot be assigned: parts never change; make "
        f"another with dataclasses.replace(part, {name}=...)"
    )


def _refuse_deletion(self: Any, name: str) -> NoReturn:
    """Raise: a value does not change."""
    raise ImmutableError(f"{type(self).__name__}.{name} cannot be deleted")
