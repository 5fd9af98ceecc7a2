"""Parts as plain data, as they are in YAML."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, get_origin

import numpy as np
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from hsp_control.common.errors import ConfigError
from hsp_control.declaration import schema
from hsp_control.declaration.by_type import ByType, as_entry
from hsp_control.declaration.families import Declared, same
from hsp_control.declaration.imported import name_of
from hsp_control.declaration.located import within

_SIMPLE = bool, int, float, str, type(None)


def plain_data(value: Any, *, defaults: bool = False) -> Any:
    """Return a value as mappings, lists, numbers and text, with defaults or without."""
    if isinstance(value, _SIMPLE):
        return value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Declared):
        return _of_part(value, defaults)
    if isinstance(value, BaseModel):
        return _of_model(value, defaults)
    if isinstance(value, Mapping):
        return {key: _entry(key, each, defaults) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_inside(k, each, defaults) for k, each in enumerate(value)]
    if (name := name_of(value)) is not None:
        return name
    what = getattr(value, "__qualname__", None) or f"a {type(value).__name__}"
    raise ConfigError(f"YAML cannot express {what}: it is Python, not data")


def _of_part(part: Declared, defaults: bool) -> dict[str, Any]:
    data: dict[str, Any] = {}
    if part.family is not None:
        data["type"] = _type_of(part)
    fields = part.all_fields() if defaults else part.changed_fields()
    for name, value in fields.items():
        field = schema.fields(type(part)).get(name)
        if isinstance(value, tuple) and field is not None:
            value = _keyed(value, field, defaults)
        if value is None and field is not None:
            words = (getattr(each, "none", None) for each in field.metadata)
            value = next(filter(None, words), None)
        data[name] = _inside(name, value, defaults)
    return data


def _type_of(part: Declared) -> str:
    """Return the name of the part's class in YAML."""
    if part.yaml_type is None:
        raise ConfigError(
            f"YAML has no name for {type(part).__name__}: declare it with "
            f'class {type(part).__name__}(..., type="...")'
        )
    return part.yaml_type


def _keyed(parts: tuple[Any, ...], field: FieldInfo, defaults: bool) -> Any:
    """Return parts as the mapping that YAML gives for a field, if it is one."""
    if any(isinstance(each, ByType) for each in field.metadata):
        return {
            _type_of(each): each.all_fields() if defaults else as_entry(each)
            for each in parts
        }
    (option, *_) = schema.field_shape(field).options
    if get_origin(option) is dict:
        return {getattr(each, each.yaml_key): each for each in parts}
    return parts


def _of_model(model: BaseModel, defaults: bool) -> dict[str, Any]:
    data = {}
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        default = field.get_default(call_default_factory=True)
        if defaults or field.is_required() or not same(value, default):
            data[name] = _inside(name, value, defaults)
    return data


def _entry(key: Any, value: Any, defaults: bool) -> Any:
    """Return an entry of a mapping; a part does not repeat the name that its key is."""
    data = _inside(key, value, defaults)
    if (name := getattr(value, "yaml_key", None)) is not None:
        data.pop(name, None)
    return data


def _inside(key: str | int, value: Any, defaults: bool) -> Any:
    with within(key):
        return plain_data(value, defaults=defaults)
