"""Parts by type: mappings in YAML, whose keys are the types of a family.

``sensors: {delay: 2, position_noise: {std: 0.001}}`` is in Python
``sensors=[SensorDelay(2), PositionNoise(std=0.001)]``.
"""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    create_model,
)
from pydantic_core import CoreSchema, core_schema

from hsp_control.declaration.families import Declared
from hsp_control.declaration.language import kind, shown, spoken


class ByType:
    """The type of a field that holds parts of a family, at most one of each type.

    As an annotation: ``Annotated[Sequence[Sensor], ByType(Sensor)]``. Python gives a
    sequence of parts. YAML gives a mapping: to a mapping of fields; to the value of the
    first field alone; to ``true`` for a part without fields; to ``null`` or ``false``
    for none. The members that exist when a value is checked are used.
    """

    def __init__(self, base: type[Declared]) -> None:
        self.base = base
        self._model: type[BaseModel] | None = None

    @property
    def model(self) -> type[BaseModel]:
        """A model whose fields are the members of the family, by their YAML names."""
        assert self.base.family is not None
        members = self.base.family.members
        if self._model is None or list(self._model.model_fields) != list(members):
            entries = {name: _AfterType(each).field() for name, each in members.items()}
            self._model = create_model(
                self.base.family.name.title(),
                __config__=ConfigDict(extra="forbid", arbitrary_types_allowed=True),
                __doc__=f"{self.base.family.name.capitalize()}, by type.",
                **entries,
            )
        return self._model

    def validate(self, value: Any) -> tuple[Declared, ...]:
        """Return the parts that a mapping or a sequence gives."""
        if isinstance(value, Mapping):
            assert self.base.family is not None
            for name in value:
                self.base.family.load(name)
            made = self.model.model_validate(dict(value))
            found = (getattr(made, name) for name in value)
            return tuple(part for part in found if part is not None)
        if isinstance(value, str) or not isinstance(value, Iterable):
            needed = spoken("a mapping", f"a list of {self.base.__name__}(...)")
            raise ValueError(f"{shown(value)} is {kind(value)}; expected {needed}")
        return self._distinct(tuple(value))

    def _distinct(self, parts: tuple[Declared, ...]) -> tuple[Declared, ...]:
        """Return parts of the family."""
        assert self.base.family is not None
        for part in parts:
            if not isinstance(part, self.base):
                raise ValueError(
                    f"{part!r:.60} is not one of the {self.base.family.name}"
                )
            if sum(type(other) is type(part) for other in parts) > 1:
                raise ValueError(f"two are of the type {type(part).__name__}; give one")
        return parts

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.validate, metadata={"pydantic_js_functions": [self._json_schema]}
        )

    def _json_schema(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> Any:
        assert self.base.family is not None
        self.base.family.load_companions()
        return handler(self.model.__pydantic_core_schema__)


def as_entry(part: Declared) -> Any:
    """Return the value in YAML of a part after its type: the shortest form."""
    given = part.changed_fields()
    if not given:
        return True
    first = next(iter(part.all_fields()))
    if list(given) == [first] and not isinstance(given[first], Mapping):
        return given[first]
    return given


class _AfterType:
    """The forms in YAML that may follow a type."""

    def __init__(self, member: type[Declared]) -> None:
        self.member = member  # the class of the type
        # the name of its first field; None if it has none
        self.first = next(iter(member.__pydantic_fields__), None)  # type: ignore[attr-defined]

    def field(self) -> Any:
        """Return the field of a model, as an argument of `create_model`."""
        summary = (self.member.__doc__ or "").partition("\n")[0]
        member: Any = self.member
        annotation = Annotated[member | None, BeforeValidator(self.expand), self]
        return annotation, Field(None, description=summary)

    def expand(self, value: Any) -> Any:
        """Return a part, its fields, or None."""
        if value is None or value is False:
            return None
        if value is True:
            return {}
        if self.first is None or isinstance(value, Mapping | self.member):
            return value
        return {self.first: value}

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> Any:
        """Return a schema that permits the short forms, too."""
        made = handler(schema)
        (of_member, *_) = made.get("anyOf", [made])
        properties = handler.resolve_ref_schema(of_member).get("properties", {})
        alone = [properties[self.first]] if self.first in properties else []
        return {"anyOf": [*alone, of_member, {"type": "boolean"}, {"type": "null"}]}
