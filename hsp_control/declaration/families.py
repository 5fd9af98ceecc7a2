"""Families of parts, and the declarations of their members."""

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import MISSING, Field
from typing import Any, ClassVar, Self

import numpy as np
from pydantic_core import CoreSchema, PydanticCustomError

from hsp_control.common.entry_points import entry_points, is_ours
from hsp_control.common.errors import AccessError, ConfigError, HspControlError


class Declared:
    """A class that is declared by fields, in a family or without one: see `Part`.

    Attributes:
        family: The family that the part belongs to; None for parts of parts.
        yaml_type: Its name in YAML's ``type:``; None for parts of parts, and for
            classes that only Python uses.
        error: The class of the errors about its fields.
        yaml_key: The field that YAML gives as the key of a mapping, not inside it.
        documentation: The docstrings of fields, by name.
    """

    family: ClassVar["Family | None"] = None
    yaml_type: ClassVar[str | None] = None
    error: ClassVar[type[HspControlError]] = HspControlError
    yaml_key: ClassVar[str | None] = None
    documentation: ClassVar[Mapping[str, str]] = {}
    __pydantic_core_schema__: ClassVar[CoreSchema]

    @classmethod
    def of_value(cls, value: object) -> Self | None:
        """Return the part that a bare value means in Python; None: it means none.

        Numbers mean a point that is held, for example.
        """
        return None

    def all_fields(self) -> dict[str, Any]:
        """Return all fields, by name."""
        return {f.name: getattr(self, f.name) for f in value_fields(self)}

    def changed_fields(self) -> dict[str, Any]:
        """Return the fields that are not their defaults, by name."""
        return {
            f.name: getattr(self, f.name)
            for f in value_fields(self)
            if not _is_default(self, f)
        }


def same(a: Any, b: Any) -> bool:
    """Return whether two values of a field are equal; arrays entry by entry."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        if a is None or b is None:
            return a is b
        try:
            return bool(np.array_equal(a, b))
        except (TypeError, ValueError):
            return False
    if isinstance(a, tuple | list) and type(a) is type(b):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    return bool(a == b)


def value_fields(part: Declared | type[Declared]) -> tuple["Field[Any]", ...]:
    """Return the fields of a part."""
    return dataclasses.fields(part)  # type: ignore[arg-type]


def _is_default(part: Declared, field: "Field[Any]") -> bool:
    if field.default_factory is not MISSING:
        default = field.default_factory()
    elif field.default is MISSING:
        return False
    else:
        default = field.default
    return same(getattr(part, field.name), default)


class Family:
    """The parts of one kind: those declared here, and those of installed packages.

    A class registers itself when it is declared. A package elsewhere names its classes
    as entry points of the group ``hsp_control.<name>``; an entry point is loaded when a
    configuration uses its name, not before. A configuration can name installed parts,
    never a module or a file.

    Attributes:
        name: The family's name, in the plural.
        base: The base class of its members.
        members: The registered classes, by the names that YAML uses.
    """

    def __init__(self, name: str, base: type[Declared]) -> None:
        """Set name and base class."""
        self.name = name
        self.base = base
        self.members: dict[str, type[Declared]] = {}

    def register(self, type_name: str, member: type[Declared]) -> None:
        """Add a member.

        Raises:
            ConfigError: If another class has this name.
        """
        other = self.members.get(type_name)
        if other is not None and full_name(other) != full_name(member):
            raise ConfigError(
                f"type {type_name!r} of {self.name} is declared twice: by "
                f"{full_name(other)} and by {full_name(member)}"
            )
        # By name: messages and schemas do not depend on the order of imports.
        found = sorted({**self.members, type_name: member}.items())
        self.members.clear()
        self.members.update(found)

    def load(self, type_name: Any) -> None:
        """Import the class of a companion or an installed package, if it is not known.

        For an unknown name all companions are imported, so that a message can list
        their types.

        Raises:
            ConfigError: If it cannot be imported, or does not declare this type.
        """
        if not isinstance(type_name, str) or type_name in self.members:
            return
        entry = entry_points(self.name).get(type_name)
        if entry is None:
            self.load_companions()
            return
        check_admitted(type_name, entry.value)
        try:
            entry.load()  # it registers itself
        except (ImportError, AttributeError) as error:
            raise ConfigError(
                f"type {type_name!r} cannot be imported from {entry.value}: {error}"
            ) from error
        if type_name not in self.members:
            raise ConfigError(
                f"{entry.value} does not declare the type {type_name!r} of {self.name}"
            )

    def load_companions(self) -> None:
        """Import the members that this package's companions add."""
        for entry in entry_points(self.name).values():
            if is_ours(entry):
                entry.load()


_ADMITTED: ContextVar[frozenset[str] | None] = ContextVar("_ADMITTED", default=None)


@contextmanager
def only_packages(*names: str) -> Iterator[None]:
    """Within the block, data may name members of these packages and our own only."""
    token = _ADMITTED.set(frozenset(names) | {"hsp_control"})
    try:
        yield
    finally:
        _ADMITTED.reset(token)


def check_admitted(type_name: str, module: str) -> None:
    """Check that strict reading admits the package of a module.

    Raises:
        PydanticCustomError: With an `AccessError`, if it does not.
    """
    admitted = _ADMITTED.get()
    package = module.partition(":")[0].partition(".")[0]
    if admitted is not None and package not in admitted:
        error = AccessError(
            f"type {type_name!r} is of the package {package}, which strict reading "
            f"does not admit; if you trust it, add --allow {package}"
        )
        raise PydanticCustomError("value_error", "{error}", {"error": error})


def full_name(cls: type) -> str:
    """Return the name of a class, with that of its module."""
    return f"{cls.__module__}.{cls.__qualname__}"
