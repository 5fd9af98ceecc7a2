"""The base class of all parts: immutable values with checked fields."""

import ast
import inspect
import sys
from collections.abc import Iterator, Mapping
from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any, ClassVar, dataclass_transform

import numpy as np
from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from hsp_control.declaration.any_of import AnyOf
from hsp_control.declaration.families import Declared, same, value_fields
from hsp_control.declaration.plain_data import plain_data
from hsp_control.declaration.value_class import ValueClass


def attribute_docstrings(cls: type) -> dict[str, str]:
    """Return the docstrings of annotated attributes, as single lines, by name."""
    return _of_module(cls.__module__).get(cls.__qualname__, {})


@cache
def _of_module(module: str) -> dict[str, dict[str, str]]:
    try:
        source = inspect.getsource(sys.modules[module])
    except (KeyError, OSError, TypeError):
        return {}
    return dict(_of_classes(ast.parse(source), ""))


def _of_classes(node: ast.AST, prefix: str) -> Iterator[tuple[str, dict[str, str]]]:
    for each in ast.iter_child_nodes(node):
        if isinstance(each, ast.ClassDef):
            name = f"{prefix}{each.name}"
            yield name, dict(_of_attributes(each))
            yield from _of_classes(each, f"{name}.")
        elif isinstance(each, ast.FunctionDef):
            yield from _of_classes(each, f"{prefix}{each.name}.<locals>.")


def _of_attributes(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    for field, below in zip(node.body, node.body[1:], strict=False):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(below, ast.Expr)
            and isinstance(below.value, ast.Constant)
            and isinstance(below.value.value, str)
        ):
            yield field.target.id, " ".join(below.value.value.split())


class _Documentation:
    """The docstrings of fields: sources are read on request."""

    def __get__(self, part: object, cls: type["Part"]) -> dict[str, str]:
        found: dict[str, str] = {}
        for base in reversed(cls.__mro__):
            if issubclass(base, Part):
                found |= attribute_docstrings(base)
        return found


@dataclass_transform(frozen_default=True)
class Part(Declared, metaclass=ValueClass):
    """A value that declares one part of a controller, a world or a simulation.

    A subclass annotates its fields, with docstrings that give their meaning and
    unit. From this one declaration come the constructor and its checks, the YAML and
    JSON schemas, the reference pages and the messages::

        class Circle(Trajectory, type="circle"):
            \"\"\"x(t) = c + r (cos ωt, sin ωt).\"\"\"

            radius: Positive
            \"\"\"r [m].\"\"\"
            angular_rate: Number
            \"\"\"ω [rad/s].\"\"\"

    A part refers to no robot. It never changes: its fields cannot be assigned, and the
    arrays among them are read-only; `dataclasses.replace` returns a changed copy. Parts
    are equal if their fields are, have a hash, and can be pickled; their `repr` is the
    call that makes them. A method ``__post_init__`` may check how the fields fit
    together. A field may implement a property that a base class requires.
    """

    documentation = _Documentation()
    _docstring: ClassVar[str]  # without the fields' own

    @classmethod
    def __get_pydantic_core_schema__(
        cls, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return the schema; for the base of a family, that of all its members."""
        if cls.family is not None and cls.family.base is cls and source is cls:
            return AnyOf(cls).core_schema()
        return handler(source)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Return the JSON schema, with the docstrings of the fields."""
        made = handler(schema)
        cls.describe(handler.resolve_ref_schema(made))
        return made

    @classmethod
    def describe(cls, schema: JsonSchemaValue) -> None:
        """Add the docstrings of the fields to a JSON schema of the part, in place."""
        if "description" in schema:
            schema["description"] = cls._docstring
        if cls.yaml_key is not None:
            schema.get("properties", {}).pop(cls.yaml_key, None)
            if cls.yaml_key in schema.get("required", []):
                schema["required"].remove(cls.yaml_key)
        for name, about in schema.get("properties", {}).items():
            about.pop("title", None)
            if "oneOf" in about:  # a part; its default would need its type
                about.pop("default", None)
            if about.get("type") == "object" and about.get("default") == []:
                about["default"] = {}  # no parts, by name
            if name in cls.documentation:
                about["description"] = cls.documentation[name]

    def __post_init__(self) -> None:
        """Check how the fields fit together; by default they always do."""
        self._complete()

    def _complete(self) -> None:
        """Set fields whose default depends on others, by `_set_default`."""

    def _set_default(self, field: str, value: object) -> None:
        """Give a field its value while the part is made."""
        vars(self)[field] = value

    def to_dict(self) -> dict[str, Any]:
        """Return the part as YAML has it: type, and fields that are not defaults.

        Raises:
            ConfigError: If a field has no form in YAML, such as a Python function.
        """
        data: dict[str, Any] = plain_data(self)
        return data

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Part) or type(self) is not type(other):
            return NotImplemented
        return all(
            same(getattr(self, f.name), getattr(other, f.name))
            for f in value_fields(self)
        )

    def __hash__(self) -> int:
        values = (_hashable(getattr(self, f.name)) for f in value_fields(self))
        return hash((type(self), *values))

    def __repr__(self) -> str:
        shown = (f"{n}={_shown(v)}" for n, v in self.changed_fields().items())
        return f"{type(self).__name__}({', '.join(shown)})"

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in value_fields(self)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        _freeze(state)
        vars(self).update(state)

    def __copy__(self) -> "Part":
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> "Part":
        """Return the value itself, unless a stream's run is in it."""
        given: dict[str, Any] = self.all_fields()
        made = {name: _copied(value, memo) for name, value in given.items()}
        changed = {name: made[name] for name in given if made[name] is not given[name]}
        return replace(self, **changed) if changed else self  # type: ignore[type-var]


def _copied(value: Any, memo: dict[int, Any]) -> Any:
    """Return the deep copy of a field: only parts can have something that moves."""
    if isinstance(value, Part):
        return deepcopy(value, memo)
    if isinstance(value, Mapping):
        made = {key: _copied(each, memo) for key, each in value.items()}
        return value if all(made[key] is value[key] for key in made) else made
    if isinstance(value, tuple | list):
        items = [_copied(each, memo) for each in value]
        same = all(a is b for a, b in zip(items, value, strict=True))
        return value if same else type(value)(items)
    return value


def _hashable(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.shape, (value + 0.0).tobytes()  # + 0.0: -0.0 equals 0.0
    if isinstance(value, tuple | list):
        return tuple(map(_hashable, value))
    if isinstance(value, dict):
        return frozenset((key, _hashable(each)) for key, each in value.items())
    return value


def _shown(value: Any) -> str:
    """Return Python that makes the value; arrays as lists of numbers."""
    return repr(_listed(value))


def _listed(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {key: _listed(each) for key, each in value.items()}
    if isinstance(value, tuple | list):
        return type(value)(map(_listed, value))
    return value


def _freeze(value: Any) -> None:
    """Make arrays read-only, those in tuples and mappings included."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, dict | tuple | list):
        for each in value.values() if isinstance(value, dict) else value:
            _freeze(each)
