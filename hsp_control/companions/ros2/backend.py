"""The scheme ``ros2://`` of ``hsp live``; needs Cyclone DDS only when it is used."""

from hsp_control.companions.ros2.installed import check_installed
from hsp_control.live.hardware import Hardware, Publisher
from hsp_control.robot import Robot
from hsp_control.simulation.control_chain import EffortSource


def connect(address: str, robot: Robot, period: float) -> Hardware:
    """Return the robot whose states and commands are topics of ROS 2.

    Args:
        address: ``CONTROLLER?states=TOPIC&joints=A,B&domain=N``; see `Ros2Hardware`.
        robot: The controller's model.
        period: The control period [s].

    Raises:
        HardwareError: If Cyclone DDS is not installed, or the robot is not there.
    """
    check_installed()
    from hsp_control.companions.ros2.hardware import Ros2Hardware

    return Ros2Hardware(address, robot, period)


def publish(address: str, effort_source: EffortSource) -> Publisher:
    """Return a publisher of a loop's states and poses; see `Watched`.

    Args:
        address: ``NAME?rate=HZ&domain=N``.
        effort_source: The source of the efforts.

    Raises:
        HardwareError: If Cyclone DDS is not installed, or the address is invalid.
    """
    check_installed()
    from hsp_control.companions.ros2.watch import Watched

    return Watched(address, effort_source)
