"""A Franka arm (pylibfranka): ``hsp live CONFIG --robot franka://ADDRESS``."""

from typing import TYPE_CHECKING

from hsp_control.companions.shared import at_first_use

if TYPE_CHECKING:  # for type checkers only: a help text must not import slow modules
    from .connection import connect as connect
    from .hardware import FrankaHardware as FrankaHardware
    from .settings import FrankaSettings as FrankaSettings
    from .settings import Load as Load

__getattr__, __dir__ = at_first_use(
    __name__,
    {
        "connection": "connect",
        "hardware": "FrankaHardware",
        "settings": "FrankaSettings Load",
    },
)
