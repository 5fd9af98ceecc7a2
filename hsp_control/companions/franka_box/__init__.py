"""A Franka's control box without a robot: for unmodified clients of libfranka."""

from typing import TYPE_CHECKING

from hsp_control.companions.shared import at_first_use

if TYPE_CHECKING:  # for type checkers only: a help text must not import slow modules
    from .arm import Arm as Arm
    from .box import ControlBox as ControlBox
    from .server import DEADLINE as DEADLINE
    from .server import Server as Server

__getattr__, __dir__ = at_first_use(
    __name__,
    {
        "arm": "Arm",
        "box": "ControlBox",
        "server": "DEADLINE Server",
    },
)
