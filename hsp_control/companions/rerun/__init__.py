"""Runs in Rerun's viewer."""

from typing import TYPE_CHECKING

from hsp_control.companions.shared import at_first_use

if TYPE_CHECKING:  # for type checkers only: a help text must not import slow modules
    from .log import log_to_rerun as log_to_rerun

__getattr__, __dir__ = at_first_use(
    __name__,
    {
        "log": "log_to_rerun",
    },
)
