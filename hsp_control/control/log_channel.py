"""What the parts of a loop tell of themselves, for the log."""

from typing import NamedTuple

from hsp_control.common.arrays import Array


class LogChannel(NamedTuple):
    """Something that a plant can tell of itself; it becomes a column of the log.

    Attributes:
        value: A number or an array whose shape never changes.
        unit: Its SI unit.
        meaning: What it is, in a few words.
    """

    value: Array | float
    unit: str
    meaning: str
