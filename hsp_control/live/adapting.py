"""Robots that know where they are, and how they take efforts, before the run."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from hsp_control.common.arrays import Array
from hsp_control.live.hardware import Hardware
from hsp_control.live.settings import LiveSettings


@runtime_checkable
class LocatedHardware(Hardware, Protocol):
    """`Hardware` that knows where the robot is: a run can begin there."""

    q: Array  # its configuration when it was connected, shape (nq,)


@runtime_checkable
class AdaptingHardware(LocatedHardware, Protocol):
    """`Hardware` that corrects the settings of its loop, and tells what it found."""

    lines: Sequence[str]  # what the user should know of the robot, one sentence each

    @property
    def fault(self) -> str | None:
        """The fault, or None."""

    def adapted(self, settings: LiveSettings) -> LiveSettings:
        """Return the settings with what is fixed on this robot."""
