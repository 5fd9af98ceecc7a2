"""What a live loop needs of a robot: its state, its efforts, its period."""

from typing import NamedTuple, Protocol, runtime_checkable

from hsp_control.common.arrays import Array


class Measurement(NamedTuple):
    """What the robot says of itself.

    Attributes:
        sequence: Grows by one with every measurement that the robot makes: a gap tells
            how many were not seen, the same number again that nothing is new.
        t: When, on the robot's own clock [s]; trajectories follow this time.
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        age: How old it is, as far as the hardware can tell [s].
        halted: Whether the robot has stopped by itself and follows no effort.
    """

    sequence: int
    t: float
    q: Array
    v: Array
    age: float = 0.0
    halted: bool = False


@runtime_checkable
class Hardware(Protocol):
    """A robot under effort control: write one such class for each kind of robot.

    The loop reads once and then, for seconds, does nothing but compile. From the second
    read on it reads once a period, and each read is followed by a write, until it is
    done and closes.

    Attributes:
        period: Time between two measurements [s].
    """

    period: float

    def read(self, timeout: float) -> Measurement | None:
        """Return the newest measurement not yet returned, as soon as there is one.

        Args:
            timeout: How long to wait for it at most [s]; 0: not at all.

        Returns:
            The measurement, in arrays that are not written again; None if none came.

        Raises:
            HardwareError: If none will ever come.
        """

    def write(self, effort: Array) -> None:
        """Send an effort, shape (nv,), to be held until the next; never waits.

        Raises:
            HardwareError: If the robot cannot be reached.
        """

    def close(self) -> None:
        """Say that no more efforts will come; again is no error."""
