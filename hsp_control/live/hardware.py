"""The interface of a robot: required and optional methods, and its connection."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import EntryPoint
from typing import Protocol, runtime_checkable

from hsp_control.common.arrays import Array
from hsp_control.common.entry_points import entry_points
from hsp_control.common.errors import HardwareError, HspControlError, LiveError
from hsp_control.common.suggestions import listing, nearest
from hsp_control.control.measurement import Measurement as Measurement
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot
from hsp_control.simulation.control_chain import EffortSource


@runtime_checkable
class Hardware(Protocol):
    """A robot under effort control: implement it once per type of robot.

    The loop calls `read` once, and then prepares for some time. From the second `read`
    on, it calls `read` and `write` once a period, and `close` at the end. Without a
    valid state, it calls `close` without further writes.

    After the first effort any exception of the methods is reported, also one that is
    not an `Exception`. An exception of `read` means that no state can arrive any more:
    the loop stops sending. If `write` raises, it continues with the safe stop.

    Hardware in real time may have an attribute ``real_time`` that is true: its clock is
    then compared with this computer's.

    Attributes:
        period: Time between two measurements [s].
    """

    period: float

    def read(self, timeout: float) -> Measurement | None:
        """Wait for a new measurement, and return the newest one.

        Args:
            timeout: Maximum time to wait [s]; 0: do not wait.

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
        """End the connection: no more efforts follow; a second call does nothing."""


def described(error: BaseException) -> str:
    """Return an exception's message, a foreign one's with its type; never raise."""
    name = type(error).__name__
    try:
        message = str(error)
    except BaseException:  # also SystemExit: who describes an error goes on
        return name
    if isinstance(error, HspControlError | OSError) and message:
        return message
    return f"{name}: {message}" if message else name


@runtime_checkable
class LocatedHardware(Hardware, Protocol):
    """`Hardware` with the robot's configuration: a run can begin there."""

    q: Array  # its configuration when it was connected, shape (nq,)


@runtime_checkable
class AdaptingHardware(LocatedHardware, Protocol):
    """`Hardware` that corrects the settings of its loop, and reports its findings."""

    lines: Sequence[str]  # notes on the robot for the user, one sentence each

    @property
    def fault(self) -> str | None:
        """The fault, or None."""

    def adapted(self, settings: LiveSettings) -> LiveSettings:
        """Return the settings with the values prescribed by this robot."""


def connect(url: str, robot: Robot, period: float) -> Hardware:
    """Return the robot at ``name://address``; an installed package provides the name.

    Its entry point of the group ``hsp_control.hardware`` is a function of the address,
    the model and the period, which returns the connected robot.

    Args:
        url: Name and address.
        robot: The controller's model.
        period: The control period [s].

    Raises:
        LiveError: If no package provides the name.
        HardwareError: If the robot cannot be reached.
    """
    with _foreign("--robot", url):
        address, known = installed("--robot", url, "hardware")
        make: Callable[[str, Robot, float], Hardware] = known.load()
        return make(address, robot, period)


class Publisher(Protocol):
    """Publishes the state of a loop; `run_loop` calls it as ``on_period``."""

    def __call__(self, t: float) -> object:
        """Publish the state at the controller's time t [s], if it is due."""

    def ended(self, ended: str, reason: str) -> object:
        """Publish the end of the run, as in `LoopReport`."""


def publish(url: str, source: EffortSource) -> Publisher:
    """Return the publisher of a loop to listeners at an address.

    Args:
        url: ``name://address``; an entry point of ``hsp_control.publishers`` has it.
        source: The source of the efforts.

    Raises:
        LiveError: If no package provides the name.
        HardwareError: If the address is wrong, or something is not installed.
    """
    with _foreign("--publish", url):
        address, known = installed("--publish", url, "publishers")
        make: Callable[[str, EffortSource], Publisher] = known.load()
        return make(address, source)


@contextmanager
def _foreign(option: str, url: str) -> Iterator[None]:
    """Name the option whose package raises."""
    try:
        yield
    except HspControlError:
        raise
    except Exception as error:
        raise HardwareError(f"{option} {url!r}: {described(error)}") from error


def installed(option: str, url: str, group: str) -> tuple[str, EntryPoint]:
    """Return the address and the installed entry of a group for ``name://address``."""
    name, separator, address = url.partition("://")
    known = entry_points(group)
    if not separator or name not in known:
        there = listing(known) or "none"
        near = nearest(name, known)
        raise LiveError(
            f"{option} {url!r}: needs NAME://ADDRESS with a name that an installed "
            f"package provides{f'; did you mean {near}://ADDRESS?' if near else ''} "
            f"(installed: {there})"
        )
    return address, known[name]
