"""A transport that keeps the scene in memory: for tests and for export."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.commands import Command, Json, unpack
from hsp_control.visualization.viewer.latest_commands import LatestCommands, key_of


class Recorder:
    """A transport without server and page: it stores the commands.

    Attributes:
        scene: The commands that build the scene.
    """

    url = None

    def __init__(self) -> None:
        """Start with an empty scene."""
        self.scene = LatestCommands()

    def send(self, commands: Iterable[Command]) -> None:
        """Store commands."""
        for command in commands:
            command.keep_in(self.scene)

    def wait_for_page(self, timeout: float) -> bool:
        """Return False at once: there is no page."""
        return False

    def wait_until_closed(self) -> None:
        """Return at once: there is no page."""

    def close(self) -> None:
        """Do nothing; the stored commands remain."""

    def paths(self, below: str = "") -> list[str]:
        """Return the paths of all objects that begin with ``below``."""
        return [
            path
            for path, name, _ in self.scene.items()
            if name == "object" and path.startswith(below)
        ]

    def command(self, path: str, name: str) -> Json | None:
        """Return the command that set the property ``name`` of a node, or None."""
        packed = self.scene.get(key_of(path, name))
        return None if packed is None else unpack(packed)

    def transform(self, path: str) -> Array:
        """Return the pose of a node in the world, shape (4, 4)."""
        total: Array = np.eye(4)
        nodes = path.split("/")
        for depth in range(2, len(nodes) + 1):
            command = self.command("/".join(nodes[:depth]), "transform")
            if command is not None:
                matrix: Any = command["matrix"]
                total = total @ np.reshape(matrix, (4, 4)).T
        return total
