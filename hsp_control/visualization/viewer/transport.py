"""Where a viewer's commands go: to a server that shows them, or into a record."""

from collections.abc import Iterable
from typing import Protocol

from hsp_control.visualization.viewer.commands import Command


class Transport(Protocol):
    """Takes commands and answers for whoever looks at them."""

    @property
    def url(self) -> str | None:
        """The page's address; None where there is no page."""

    def send(self, commands: Iterable[Command]) -> None:
        """Pass commands on, to be shown together.

        Raises:
            ViewerError: If nobody takes them any more.
        """

    def wait_for_page(self, timeout: float) -> bool:
        """Wait until a page shows all that was sent [s]; return whether one does."""

    def wait_until_closed(self) -> None:
        """Wait until no page is open any more."""

    def close(self) -> None:
        """Stop; again is no error."""
