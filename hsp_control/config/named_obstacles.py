"""Obstacles that parts hold themselves move to the scene, where YAML has them."""

from dataclasses import replace
from operator import is_
from typing import Any, cast

from hsp_control.common.exceptions import SceneError
from hsp_control.declaration import Part
from hsp_control.geometry import Obstacle, Scene


def named_obstacles(scene: Scene, parts: Any) -> tuple[Scene, Any]:
    """Return parts with names instead of obstacles, and the scene that has them."""
    known = dict(scene)

    def named(value: Any) -> Any:
        if isinstance(value, Obstacle):
            if known.setdefault(value.name, value) != value:
                raise SceneError(f"two obstacles have the name {value.name!r}")
            return value.name
        if isinstance(value, tuple):
            new = tuple(map(named, value))
            return value if all(map(is_, value, new)) else new
        if isinstance(value, Part):
            fields = value.all_fields()
            found = {name: named(each) for name, each in fields.items()}
            changed = {k: each for k, each in found.items() if each is not fields[k]}
            return replace(cast("Any", value), **changed) if changed else value
        return value

    parts = named(parts)
    return (scene if len(known) == len(scene) else Scene(known.values())), parts
