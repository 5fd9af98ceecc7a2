"""Families of parts: the members that ``type:`` may name."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import fields, is_dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any, cast

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import (
    CoreSchema,
    PydanticCustomError,
    SchemaValidator,
    core_schema,
)

from hsp_control.common.exceptions import AccessError, ConfigError
from hsp_control.declaration.plain import joined
from hsp_control.declaration.quantities import plain

if TYPE_CHECKING:
    from hsp_control.declaration.part import Part


class Family:
    """The parts of one kind: those declared here, and those of installed packages.

    A class registers itself when it is declared. A package elsewhere names its classes
    as entry points of the group ``hsp_control.<name>``; an entry point is loaded when a
    configuration uses its name, not before. A configuration can name what is installed,
    never a module or a file.

    Attributes:
        name: The family's name, in the plural.
        base: The base class of its members.
        members: The registered classes, by the names that YAML uses.
    """

    def __init__(self, name: str, base: "type[Part]") -> None:
        """Set name and base class."""
        self.name = name
        self.base = base
        self.members: dict[str, type[Part]] = {}

    def register(self, type_name: str, member: "type[Part]") -> None:
        """Add a member.

        Raises:
            ConfigError: If another class has this name.
        """
        other = self.members.get(type_name)
        if other is not None and _full_name(other) != _full_name(member):
            raise ConfigError(
                f"type {type_name!r} of {self.name} is declared twice: by "
                f"{_full_name(other)} and by {_full_name(member)}"
            )
        self.members[type_name] = member

    def core_schema(self) -> CoreSchema:
        """Return pydantic's schema of any member."""
        return AnyOf(self.base).core_schema()

    def entry_points(self) -> dict[str, EntryPoint]:
        """Return what installed packages add, by name."""
        return {e.name: e for e in entry_points(group=f"hsp_control.{self.name}")}

    def load(self, type_name: Any) -> None:
        """Import the class of an installed package, if it is not yet known.

        Raises:
            ConfigError: If it cannot be imported, or does not declare this type.
        """
        if not isinstance(type_name, str) or type_name in self.members:
            return
        entry = self.entry_points().get(type_name)
        if entry is None:
            return
        _check_admitted(type_name, entry.value)
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


class AnyOf:
    """The type of a field that holds a member of one of some families.

    As an annotation: ``Annotated[PoseTrajectory | Trajectory, AnyOf(PoseTrajectory,
    Trajectory)]``. The members that exist when a value is checked count, not those that
    exist when the field is declared. If a type name is in several families, the first
    one counts that has all keys which are given.
    """

    def __init__(self, *bases: "type[Part]") -> None:
        """Set the base classes of the families."""
        self.bases = bases
        self._checked: dict[str, type[Part]] = {}
        self._validator: SchemaValidator | None = None

    @property
    def members(self) -> "dict[str, type[Part]]":
        """The registered classes of all families, by their YAML names."""
        found: dict[str, type[Part]] = {}
        for base in reversed(self.bases):
            assert base.family is not None
            found |= base.family.members
        return found

    def validate(self, value: Any) -> Any:
        """Return a part: the value itself, or the part that a mapping declares."""
        if isinstance(value, self.bases):
            return value
        if hasattr(type(value), "yaml_type"):
            names = joined([base.family.name for base in self.bases if base.family])
            raise ValueError(f"a {type(value).__name__} is not one of the {names}")
        if isinstance(value, dict):
            for base in self.bases:
                assert base.family is not None
                base.family.load(value.get("type"))
        members = self.members | self._fitting(value)
        if isinstance(value, dict) and (member := members.get(str(value.get("type")))):
            _check_admitted(str(value["type"]), member.__module__)
            _check_complete(str(value["type"]), member)
        if self._validator is None or members != self._checked:
            self._checked = members
            self._validator = SchemaValidator(_union(members))
        return self._validator.validate_python(plain(value))

    def _fitting(self, value: object) -> "dict[str, type[Part]]":
        """Return the member of the value's type that has its keys, if there is one."""
        if not isinstance(value, dict):
            return {}
        name, keys = str(value.get("type")), set(value) - {"type"}
        families = [base.family.members for base in self.bases if base.family]
        named = [members[name] for members in families if name in members]
        fitting = [
            member
            for member in named
            if is_dataclass(member) and keys <= {each.name for each in fields(member)}
        ]
        return {name: fitting[0]} if fitting else {}

    def core_schema(self) -> CoreSchema:
        """Return pydantic's schema."""
        return core_schema.no_info_plain_validator_function(
            self.validate, metadata={"pydantic_js_functions": [self._json_schema]}
        )

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return pydantic's schema."""
        return self.core_schema()

    def _json_schema(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> Any:
        options = [
            _described(name, member, handler) for name, member in self.members.items()
        ]
        return {"oneOf": options, "discriminator": {"propertyName": "type"}}


_UNDER_WAY: set[str] = set()
"""The members whose JSON schemas are being made: one may contain its own family."""


def _described(name: str, member: "type[Part]", handler: GetJsonSchemaHandler) -> Any:
    """Return a reference to the JSON schema of a member, which is made if needed."""
    full_name = _full_name(member)
    definition = core_schema.definition_reference_schema(full_name)
    reference = handler(definition)
    if full_name in _UNDER_WAY or _is_known(reference, handler):
        return reference
    schema, others = _own_and_others(member)
    own = cast(CoreSchema, {**schema, "ref": full_name})
    _UNDER_WAY.add(full_name)
    try:
        handler(core_schema.definitions_schema(definition, [own, *others]))
    finally:
        _UNDER_WAY.discard(full_name)
    described = handler.resolve_ref_schema(reference)
    summary = described.get("description", "").partition("\n")[0]
    described["properties"] = {
        "type": {"const": name, "description": f"{name}: {summary}"},
        **described.get("properties", {}),
    }
    described["required"] = ["type", *described.get("required", [])]
    return reference


def _is_known(reference: Any, handler: GetJsonSchemaHandler) -> bool:
    try:
        handler.resolve_ref_schema(reference)
    except LookupError:
        return False
    return True


_ADMITTED: ContextVar[frozenset[str] | None] = ContextVar("_ADMITTED", default=None)


@contextmanager
def only_packages(*names: str) -> Iterator[None]:
    """Within the block, data may name members of these packages and our own only."""
    token = _ADMITTED.set(frozenset(names) | {"hsp_control"})
    try:
        yield
    finally:
        _ADMITTED.reset(token)


def _check_admitted(type_name: str, module: str) -> None:
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


def _check_complete(type_name: str, member: "type[Part]") -> None:
    """Check that a class implements what its family asks for.

    Raises:
        ConfigError: If it does not.
    """
    missing = sorted(getattr(member, "__abstractmethods__", ()))
    if missing:
        raise ConfigError(
            f"type {type_name!r}: {_full_name(member)} does not implement "
            f"{joined(missing)}"
        )


def _union(members: "dict[str, type[Part]]") -> CoreSchema:
    choices: dict[str, CoreSchema] = {}
    shared: dict[str, CoreSchema] = {}  # each definition once, whoever refers to it
    for name, member in members.items():
        schema, others = _own_and_others(member)
        shared |= {str(other["ref"]): other for other in others}
        choices[name] = core_schema.no_info_before_validator_function(
            _without_type, schema
        )
    union = core_schema.tagged_union_schema(choices, discriminator="type")
    return core_schema.definitions_schema(union, [*shared.values()])


def _own_and_others(member: "type[Part]") -> tuple[CoreSchema, list[CoreSchema]]:
    """Return the schema of a member, and the definitions that it refers to."""
    schema: Any = member.__pydantic_core_schema__
    if schema["type"] == "definitions":
        return schema["schema"], schema["definitions"]
    return schema, []


def _without_type(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: each for key, each in value.items() if key != "type"}
    return value


def _full_name(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"
