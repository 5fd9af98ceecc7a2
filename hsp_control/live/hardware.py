"""What a robot must offer to be controlled, and what it may."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError
from hsp_control.control.measurement import Measurement as Measurement
from hsp_control.live.settings import LiveSettings


@runtime_checkable
class Hardware(Protocol):
    """A robot under effort control: implement it once for each kind of robot.

    The loop calls `read` once, and then compiles kernels for some seconds. From the
    second `read` on, it calls `read` and `write` once a period, and `close` at the end.
    If it has no valid state any more, it calls `close` without further writes.

    Once the first effort is out, whatever the methods raise ends in the report. What
    `read` raises means that no state can arrive any more: the loop sends nothing more.
    After what `write` raises it goes on trying, with the safe stop.

    Attributes:
        period: Time between two measurements [s].
    """

    period: float

    def read(self, timeout: float) -> Measurement | None:
        """Wait for a new measurement, and return the newest one.

        Args:
            timeout: Longest time to wait [s]; 0: do not wait.

        Returns:
            The measurement; its arrays must not be overwritten later. None if no new
            one arrived.

        Raises:
            HardwareError: If no measurement can arrive any more.
        """

    def write(self, effort: Array) -> None:
        """Send an effort, shape (nv,), without waiting; it is held until the next.

        Raises:
            HardwareError: If the robot cannot be reached.
        """

    def close(self) -> None:
        """Tell the robot that no more efforts follow; a second call does nothing."""


def described(error: BaseException) -> str:
    """Return an exception's message, a foreign one's with its type; never raise."""
    name = type(error).__name__
    try:
        message = str(error)
    except Exception:
        return name
    if isinstance(error, HspControlError | OSError) and message:
        return message
    return f"{name}: {message}" if message else name


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
