"""Mesh files: a live page receives each once, for any number of links and robots."""

import hashlib
from collections.abc import Iterable, Iterator
from typing import Any

from hsp_control.companions.viewer.commands import (
    MESHES,
    Json,
    PageCommand,
    pack,
    page_command,
)

_FILE = ("data", "resources")
"""Keys of a geometry or an object with the file's content; ``file`` replaces them."""


class MeshFiles:
    """The files of some objects."""

    def __init__(self) -> None:
        """Begin without files."""
        self._known: dict[str, PageCommand] = {}

    def taken_from(self, thing: Json) -> Json:
        """Return an object with names in place of its files, which are stored here."""
        geometries = [self._named(each) for each in thing.get("geometries", [])]
        return {
            **thing,
            "geometries": geometries,
            "object": self._named(thing["object"]),
        }

    def commands(self) -> Iterable[PageCommand]:
        """Return the commands with the files, to be sent before the objects."""
        return self._known.values()

    def _named(self, owner: Json) -> Json:
        if not str(owner["type"]).startswith("_meshfile"):
            return owner
        content = {key: owner[key] for key in _FILE if key in owner}
        name = hashlib.sha256(pack(content)).hexdigest()[:24]
        if name not in self._known:
            known = page_command("mesh_file", MESHES, name, file=name, **content)
            self._known[name] = known
        rest = {key: value for key, value in owner.items() if key not in content}
        return {**rest, "file": name}


def with_files(commands: Iterable[Json]) -> Iterator[Json]:
    """Yield the commands of a scene with the files where their names were."""
    files: dict[str, Json] = {}
    for command in commands:
        if command["type"] == "mesh_file":
            files[command["file"]] = {k: command[k] for k in _FILE if k in command}
        elif command["type"] == "set_object":
            yield {**command, "object": _filled(command["object"], files)}
        else:
            yield command


def _filled(value: Any, files: dict[str, Json]) -> Any:
    if isinstance(value, list):
        return [_filled(each, files) for each in value]
    if not isinstance(value, dict):
        return value
    if value.get("file") in files:
        return {**value, **files[value["file"]]}
    parts = ("geometries", "object", "children")
    return value | {key: _filled(value[key], files) for key in parts if key in value}
