"""Robots that installed packages can reach: ``hsp live --robot name://address``."""

from importlib.metadata import entry_points
from typing import Protocol

from hsp_control.common.exceptions import LiveError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.live.hardware import Hardware
from hsp_control.robot import Robot

GROUP = "hsp_control.hardware"
"""The group of the entry points; each is a `Connect`."""


class Connect(Protocol):
    """Connects to a robot: the function that a package names as an entry point."""

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
    name, separator, address = url.partition("://")
    known = {entry.name: entry for entry in entry_points(group=GROUP)}
    if not separator or name not in known:
        there = listing(known) or "none"
        raise LiveError(
            f"--robot {url!r}: needs NAME://ADDRESS with a name that an installed "
            f"package provides{did_you_mean(name, known)} (installed: {there})"
        )
    make: Connect = known[name].load()
    return make(address, robot, period)
