"""Contact forces as log channels of a plant."""

from collections.abc import Mapping

from hsp_control.common.arrays import Array
from hsp_control.control.log_channel import LogChannel


def contact_channels(wrenches: Mapping[str, Array]) -> dict[str, LogChannel]:
    """Return ``plant.contact.<name>.force`` and ``.moment`` for each contact.

    A wrench (6,) of the world on the robot is force and moment in world axes, about the
    origin of the contact's frame.
    """
    channels: dict[str, LogChannel] = {}
    for name, wrench in wrenches.items():
        force = LogChannel(wrench[:3], "N", "of the world on the robot, in world axes")
        moment = LogChannel(wrench[3:], "N·m", "on the robot, about the frame's origin")
        channels[f"plant.contact.{name}.force"] = force
        channels[f"plant.contact.{name}.moment"] = moment
    return channels
