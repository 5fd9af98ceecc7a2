"""The values that a part or a pydantic model accepts, from its annotations."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from types import UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin

from pydantic import RootModel
from pydantic.fields import FieldInfo

from hsp_control.declaration.any_of import AnyOf
from hsp_control.declaration.by_type import ByType
from hsp_control.declaration.quantities import ArrayField


class _Discriminator(NamedTuple):
    discriminator: str


_BY_TYPE = _Discriminator("type")
"""The key that selects the member of a family."""


class ValueTypes(NamedTuple):
    """The types that a value may have."""

    options: tuple[Any, ...]  # the types; ``Any`` for a type whose inside is not known
    # pydantic's constraints beside the type: bounds, discriminators
    metadata: tuple[Any, ...] = ()
    # the key whose value chose this type among others, if one did
    tag: str | None = None

    @property
    def discriminator(self) -> str | None:
        """The key whose value chooses among the options, if there is one."""
        names = (getattr(data, "discriminator", None) for data in self.metadata)
        return next((name for name in names if isinstance(name, str)), None)

    def bounds(self) -> tuple[int, int | None]:
        """Return the smallest and largest number of entries, or of characters."""
        for option in self.options:
            if get_origin(option) is tuple and Ellipsis not in get_args(option):
                return len(get_args(option)), len(get_args(option))
        fewest = _first(getattr(data, "min_length", None) for data in self.metadata)
        most = _first(getattr(data, "max_length", None) for data in self.metadata)
        return fewest or 0, most


def shape(annotation: Any, *metadata: Any) -> ValueTypes:
    """Return the shape of an annotation: its types without ``Annotated`` or aliases."""
    known = tuple(_flat(metadata))
    for each in known:  # pydantic keeps the marker of a field here
        if isinstance(each, ArrayField):
            return shape(each.items)
        if isinstance(each, AnyOf):
            return ValueTypes(tuple(each.members.values()), (_BY_TYPE,))
        if isinstance(each, ByType):
            return ValueTypes((each.model,))
    if get_origin(annotation) is Annotated:
        inner, *more = get_args(annotation)
        for each in more:
            if isinstance(each, ArrayField):
                return shape(each.items, *known)
            if isinstance(each, AnyOf):
                return ValueTypes(tuple(each.members.values()), (*known, _BY_TYPE))
            if isinstance(each, ByType):
                return ValueTypes((each.model,), known)
        return shape(inner, *more, *known)
    if hasattr(annotation, "__value__"):  # an alias: type Gain = float | list[float]
        return shape(annotation.__value__, *known)
    if get_origin(annotation) in (Union, UnionType):
        options = [o for o in get_args(annotation) if o is not type(None)]
        if len(options) > 1:
            return ValueTypes(tuple(options), known)
        return shape(options[0], *known)
    family = getattr(annotation, "family", None)
    if family is not None and family.base is annotation:
        return ValueTypes(tuple(family.members.values()), (*known, _BY_TYPE))
    if isinstance(annotation, type) and issubclass(annotation, RootModel):
        return field_shape(annotation.model_fields["root"])
    return ValueTypes((annotation,), known)


def field_shape(field: FieldInfo) -> ValueTypes:
    """Return the shape of a model's field."""
    for each in field.metadata:  # pydantic moves it out of ``Annotated``
        if isinstance(each, ArrayField | AnyOf | ByType):
            return shape(Annotated[Any, each])
    return shape(field.annotation, field)


def is_model(option: Any) -> bool:
    """Return whether a type is a part or a pydantic model."""
    return isinstance(option, type) and hasattr(option, "__pydantic_fields__")


def fields(option: Any) -> dict[str, FieldInfo]:
    """Return the fields of a part or model by the user's keys; {} for other types."""
    return {
        info.validation_alias if isinstance(info.validation_alias, str) else name: info
        for name, info in _fields(option).items()
        if name != getattr(option, "yaml_key", None)
    }


def _fields(option: Any) -> dict[str, FieldInfo]:
    if not isinstance(option, type):
        return {}
    found: dict[str, FieldInfo] = getattr(option, "__pydantic_fields__", {})
    return found


def keys(expected: ValueTypes, *, required: bool = False) -> list[str]:
    """Return the keys (or only the required ones) that a mapping of this shape has."""
    found: dict[str, FieldInfo] = {}
    for option in expected.options:
        found |= fields(option)
    names = [key for key, info in found.items() if info.is_required() or not required]
    of_part = expected.tag is not None and expected.tag not in found
    return [str(expected.tag), *names] if of_part else names


def tagged(options: Iterable[Any], discriminator: str) -> dict[Any, Any]:
    """Return the option for each value that the discriminator may have."""
    choices: dict[Any, Any] = {}
    for option in options:
        inner = shape(option)
        if yaml_type := getattr(option, "yaml_type", None):
            choices[yaml_type] = option
        elif len(inner.options) > 1:
            choices |= tagged(inner.options, discriminator)  # pydantic flattens them
        elif field := fields(inner.options[0]).get(discriminator):
            choices |= dict.fromkeys(literals(field_shape(field).options), option)
    return choices


def literals(options: Iterable[Any]) -> list[Any]:
    """Return the values of all ``Literal`` and ``Enum`` types among the options."""
    values: list[Any] = []
    for option in options:
        if get_origin(option) is Literal:
            values += get_args(option)
        elif hasattr(option, "__members__"):  # an Enum
            values += [member.value for member in option]
    return values


def entry(option: Any, key: str | int) -> ValueTypes | None:
    """Return the shape of the value at ``key`` in a value of this type."""
    if is_model(option):
        field = fields(option).get(str(key))
        return None if field is None else field_shape(field)
    container, arguments = get_origin(option), get_args(option)
    if not isinstance(container, type) or not arguments:
        return None
    if issubclass(container, Mapping):
        return shape(arguments[1])
    if container is tuple and Ellipsis not in arguments:
        known = isinstance(key, int) and key < len(arguments)
        return shape(arguments[int(key)]) if known else None
    return shape(arguments[0]) if issubclass(container, Collection) else None


def _flat(metadata: Iterable[Any]) -> Iterator[Any]:
    """Yield each item, and the items inside a ``Field(...)``."""
    for data in metadata:
        yield data
        yield from getattr(data, "metadata", ())


def _first(values: Iterable[int | None]) -> int | None:
    return next((value for value in values if value is not None), None)
