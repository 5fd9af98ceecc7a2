"""Contact forces as a plant's readings."""

from collections.abc import Mapping

from hsp_control.common.arrays import Array
from hsp_control.control.log_channel import LogChannel


def contact_channels(wrenches: Mapping[str, Array]) -> dict[str, LogChannel]:
    """Return ``plant.contact.<name>.force`` and ``.moment`` for each contact.

    Args:
        wrenches: Of the world on the robot, in the world's axes, the moment about the
            origin of the contact's frame, shape (6,) each, by name.
    """
    log_channels: dict[str, LogChannel] = {}
    for name, wrench in wrenches.items():
        force = LogChannel(wrench[:3], "N", "of the world on the robot, in world axes")
        moment = LogChannel(wrench[3:], "N·m", "the same, about the frame's origin")
        log_channels[f"plant.contact.{name}.force"] = force
        log_channels[f"plant.contact.{name}.moment"] = moment
    return log_channels
