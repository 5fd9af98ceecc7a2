"""Keeps the scene in memory, without a server: for tests and for export."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.commands import Command, Json, unpack
from hsp_control.visualization.viewer.kept import Kept, key_of


class Recorder:
    """A transport that only remembers what a page would show.

    Attributes:
        scene: The commands that build it.
    """

    url = None

    def __init__(self) -> None:
        """Start with an empty scene."""
        self.scene = Kept()

    def send(self, commands: Iterable[Command]) -> None:
        """Keep commands."""
        for command in commands:
            if command.deletes:
                self.scene.drop(command.path)
            else:
                self.scene.put(command.key, command.packed)

    def wait_for_page(self, timeout: float) -> bool:
        """Return False at once: no page will come."""
        return False

    def wait_until_closed(self) -> None:
        """Return at once: no page is open."""

    def close(self) -> None:
        """Do nothing; what was kept stays."""

    def paths(self, below: str = "") -> list[str]:
        """Return the paths of all objects, or of those below a path."""
        return [
            path
            for path, what, _ in self.scene.items()
            if what == "object" and path.startswith(below)
        ]

    def command(self, path: str, what: str) -> Json | None:
        """Return the command that set ``what`` of a node, as plain data."""
        packed = self.scene.get(key_of(path, what))
        return None if packed is None else unpack(packed)

    def transform(self, path: str) -> Array:
        """Return the pose of a node in the world: its and its parents', (4, 4)."""
        total: Array = np.eye(4)
        nodes = path.split("/")
        for depth in range(2, len(nodes) + 1):
            command = self.command("/".join(nodes[:depth]), "transform")
            if command is not None:
                matrix: Any = command["matrix"]
                total = total @ np.reshape(matrix, (4, 4)).T
        return total
