"""The shapes that logs describe: the name of a class, and its fields."""

from collections.abc import Mapping
from typing import Any

from hsp_control.declaration.families import value_fields
from hsp_control.declaration.quantities import plain
from hsp_control.geometry.shapes.primitives import Shape


def shape_to_log(shape: Shape) -> dict[str, Any]:
    """Return the fields of a shape as JSON data, for `shape_from_log`."""
    return {f.name: plain(getattr(shape, f.name)) for f in value_fields(shape)}


def shape_from_log(kind: str, parameters: Mapping[str, Any]) -> Shape | None:
    """Return the shape that a log describes, or None if the kind is unknown."""
    assert Shape.family is not None
    members = {each.__name__: each for each in Shape.family.members.values()}
    shape_class = members.get(kind)
    if shape_class is None:
        return None
    shape = shape_class(**parameters)
    assert isinstance(shape, Shape)
    return shape
