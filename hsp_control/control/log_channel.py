"""Log channels: values that parts of the control loop report to the log."""

from typing import NamedTuple

from hsp_control.common.arrays import Array


class LogChannel(NamedTuple):
    """A value that a plant or a compensator reports; it becomes a column of the log.

    Attributes:
        value: A number, or an array of constant shape.
        unit: Its SI unit.
        meaning: A short description.
    """

    value: Array | float
    unit: str
    meaning: str
