"""The interface between a live loop and a robot: states, efforts, period."""

from typing import NamedTuple, Protocol, runtime_checkable

from hsp_control.common.arrays import Array


class Measurement(NamedTuple):
    """A measured state of the robot.

    Attributes:
        sequence: Number of the measurement; the robot increments it by one. A jump is
            the number of lost states; the same number again is an old state.
        t: Time of the measurement on the robot's own clock [s]; trajectories use it.
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        age: State age, as far as the hardware knows it [s].
        halted: Whether the robot has stopped by itself and ignores efforts.
        applied: Effort the robot had when it measured, in the terms of
            `Hardware.write` (libfranka's ``tau_J_d``), shape (nv,), where the hardware
            knows it; None: what was sent last counts.
        fault: Why the robot must be stopped safely, if hardware knows a reason.
    """

    sequence: int
    t: float
    q: Array
    v: Array
    age: float = 0.0
    halted: bool = False
    applied: Array | None = None
    fault: str = ""


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
