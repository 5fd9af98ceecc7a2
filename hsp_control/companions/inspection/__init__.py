"""Implausible values of a robot's description: findings with element and remedy."""

from typing import TYPE_CHECKING

from hsp_control.companions.shared import at_first_use

if TYPE_CHECKING:  # for type checkers only: a help text must not import slow modules
    from .findings import Finding as Finding
    from .findings import Inspection as Inspection
    from .findings import inspect as inspect

__getattr__, __dir__ = at_first_use(
    __name__, {"findings": "Finding Inspection inspect"}
)
