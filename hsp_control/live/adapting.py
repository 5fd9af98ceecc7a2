"""Robots that know how they take efforts, whatever a configuration says."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from hsp_control.common.arrays import Array
from hsp_control.live.hardware import Hardware
from hsp_control.live.settings import LiveSettings


@runtime_checkable
class AdaptingHardware(Hardware, Protocol):
    """`Hardware` that corrects the settings of its loop, and tells what it found.

    Attributes:
        q: Its configuration when it was connected, shape (nq,).
        lines: What the user should know of the robot, one sentence each.
        fault: Why the robot stopped by itself or was lost, once it is known; also if
            that was after the loop's safe stop began, or only in `close`.
    """

    q: Array
    lines: Sequence[str]

    @property
    def fault(self) -> str | None:
        """The fault, or None."""

    def adapted(self, settings: LiveSettings) -> LiveSettings:
        """Return the settings with what is fixed on this robot.

        Raises:
            LiveError: If a setting contradicts the robot.
        """
