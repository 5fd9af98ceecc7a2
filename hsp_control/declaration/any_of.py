"""A part of one of some families, selected by its ``type:``."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any, cast

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic.dataclasses import rebuild_dataclass
from pydantic_core import CoreSchema, SchemaValidator, core_schema

from hsp_control.common.errors import ConfigError
from hsp_control.declaration.families import Declared, check_admitted, full_name
from hsp_control.declaration.language import joined
from hsp_control.declaration.quantities import plain


class AnyOf:
    """The type of a field that holds a member of one of some families.

    As an annotation: ``Annotated[PoseTrajectory | Trajectory, AnyOf(PoseTrajectory,
    Trajectory)]``. The members that exist when a value is checked are used, not those
    that exist when the field is declared. If a type name is in several families, the
    first member that has all given keys is used.
    """

    def __init__(self, *bases: type[Declared]) -> None:
        self.bases = bases
        self._validators: dict[str, tuple[type[Declared], SchemaValidator]] = {}

    @property
    def members(self) -> dict[str, type[Declared]]:
        """The registered classes of all families, by their YAML names."""
        found: dict[str, type[Declared]] = {}
        for base in reversed(self.bases):
            assert base.family is not None
            found |= base.family.members
        return found

    def validate(self, value: Any) -> Any:
        """Return a part: the value itself, or the part that a mapping declares."""
        if isinstance(value, self.bases):
            return value
        if isinstance(value, Declared):
            names = joined([base.family.name for base in self.bases if base.family])
            raise ValueError(f"a {type(value).__name__} is not one of the {names}")
        if isinstance(value, dict):
            for base in self.bases:
                assert base.family is not None
                base.family.load(value.get("type"))
        members = self.members | self._fitting(value)
        if isinstance(value, dict) and (member := members.get(str(value.get("type")))):
            check_admitted(str(value["type"]), member.__module__)
            _check_complete(str(value["type"]), member)
            return self._validator_of(str(value["type"]), member)(plain(value))
        # For its message, which lists all members.
        return SchemaValidator(_union(members)).validate_python(plain(value))

    def _validator_of(self, name: str, member: type[Declared]) -> Callable[[Any], Any]:
        """Return the check of one member; those of all take a third of a second."""
        known, validator = self._validators.get(name, (None, None))
        if validator is None or known is not member:
            validator = SchemaValidator(_union({name: member}))
            self._validators[name] = member, validator
        return validator.validate_python

    def _fitting(self, value: object) -> dict[str, type[Declared]]:
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
        return self.core_schema()

    def _json_schema(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> Any:
        for base in self.bases:
            assert base.family is not None
            base.family.load_companions()
        options = [
            _described(name, member, handler) for name, member in self.members.items()
        ]
        return {"oneOf": options, "discriminator": {"propertyName": "type"}}


_UNDER_WAY: set[str] = set()
"""The members whose JSON schemas are being made: one may contain its own family."""


def _described(name: str, member: type[Declared], handler: GetJsonSchemaHandler) -> Any:
    """Return a reference to the JSON schema of a member, which is made if needed."""
    ref = full_name(member)
    definition = core_schema.definition_reference_schema(ref)
    reference = handler(definition)
    if ref in _UNDER_WAY or _is_known(reference, handler):
        return reference
    schema, others = _own_and_others(member)
    own = cast(CoreSchema, {**schema, "ref": ref})
    _UNDER_WAY.add(ref)
    try:
        handler(core_schema.definitions_schema(definition, [own, *others]))
    finally:
        _UNDER_WAY.discard(ref)
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


def _check_complete(type_name: str, member: type[Declared]) -> None:
    """Check that a class implements the methods that its family requires."""
    missing = sorted(getattr(member, "__abstractmethods__", ()))
    if missing:
        raise ConfigError(
            f"type {type_name!r}: {full_name(member)} does not implement "
            f"{joined(missing)}"
        )


def _union(members: dict[str, type[Declared]]) -> CoreSchema:
    choices: dict[str, CoreSchema] = {}
    shared: dict[str, CoreSchema] = {}  # each definition once, also if used twice
    for name, member in members.items():
        schema, others = _own_and_others(member)
        shared |= {str(other["ref"]): other for other in others}
        choices[name] = core_schema.no_info_before_validator_function(
            _without_type, schema
        )
    union = core_schema.tagged_union_schema(choices, discriminator="type")
    return core_schema.definitions_schema(union, [*shared.values()])


def _own_and_others(member: type[Declared]) -> tuple[CoreSchema, list[CoreSchema]]:
    """Return the schema of a member, and the definitions that it refers to."""
    rebuild_dataclass(cast(Any, member))  # unless it was built
    schema: Any = member.__pydantic_core_schema__
    if schema["type"] == "definitions":
        return schema["schema"], schema["definitions"]
    return schema, []


def _without_type(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: each for key, each in value.items() if key != "type"}
    return value
