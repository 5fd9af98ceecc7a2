"""A robot to play with: a simulation in real time that a page steers."""

from typing import TYPE_CHECKING

from hsp_control.companions.shared import at_first_use

if TYPE_CHECKING:  # for type checkers only: a help text must not import slow modules
    from .real_time import play as play
    from .session import Session as Session

__getattr__, __dir__ = at_first_use(
    __name__, {"real_time": "play", "session": "Session"}
)
