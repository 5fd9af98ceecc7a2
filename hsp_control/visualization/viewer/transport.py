"""The interface of a viewer's transport: a server with pages, or a recorder."""

from collections.abc import Iterable
from typing import Protocol

from hsp_control.visualization.viewer.commands import Command
from hsp_control.visualization.viewer.latest_commands import LatestCommands


class Transport(Protocol):
    """Sends commands to pages, and reports whether pages are open."""

    @property
    def url(self) -> str | None:
        """The page's address; None where there is no page."""

    @property
    def scene(self) -> LatestCommands:
        """The commands that build the scene."""

    def send(self, commands: Iterable[Command]) -> None:
        """Send commands, to be shown together."""

    def wait_for_page(self, timeout: float) -> bool:
        """Wait until a page shows all that was sent; return whether one does."""

    def wait_until_closed(self) -> None:
        """Wait until no page is open any more."""

    def close(self) -> None:
        """Close it; a second call has no effect."""
