"""What installed packages connect a live loop to: robots, and those who watch."""

from collections.abc import Callable
from importlib.metadata import EntryPoint
from typing import Protocol

from hsp_control.common.entry_points import entry_points
from hsp_control.common.exceptions import LiveError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.live.hardware import Hardware
from hsp_control.robot import Robot
from hsp_control.simulation.control_chain import EffortSource


class Connect(Protocol):
    """Connects to a robot: an entry point of the group ``hsp_control.hardware``."""

    def __call__(self, address: str, robot: Robot, period: float) -> Hardware:
        """Return the connected robot.

        Args:
            address: What stands behind ``name://``.
            robot: The controller's model.
            period: The control period [s].

        Raises:
            HardwareError: If the robot cannot be reached.
        """


def connect(url: str, robot: Robot, period: float) -> Hardware:
    """Return the robot at ``name://address``; an installed package provides the name.

    Args:
        url: Name and address.
        robot: The controller's model.
        period: The control period [s].

    Raises:
        LiveError: If no package provides the name.
        HardwareError: If the robot cannot be reached.
    """
    address, known = _known("--robot", url, "hardware")
    make: Connect = known.load()
    return make(address, robot, period)


def publish(url: str, source: EffortSource) -> Callable[[float], object]:
    """Return what publishes a loop, once a period, to those who watch at an address.

    Args:
        url: ``name://address``; an entry point of ``hsp_control.publishers`` has it.
        source: What computes the efforts.

    Raises:
        LiveError: If no package provides the name.
        HardwareError: If the address is wrong, or something is not installed.
    """
    address, known = _known("--publish", url, "publishers")
    make: Callable[[str, EffortSource], Callable[[float], object]] = known.load()
    return make(address, source)


def _known(option: str, url: str, group: str) -> tuple[str, EntryPoint]:
    """Return the address and what is installed for ``name://address``."""
    name, separator, address = url.partition("://")
    known = entry_points(group)
    if not separator or name not in known:
        there = listing(known) or "none"
        raise LiveError(
            f"{option} {url!r}: needs NAME://ADDRESS with a name that an installed "
            f"package provides{did_you_mean(name, known)} (installed: {there})"
        )
    return address, known[name]
