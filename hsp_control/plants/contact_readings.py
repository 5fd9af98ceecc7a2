"""Contact forces as a plant's readings."""

from collections.abc import Mapping

from hsp_control.arrays import Array
from hsp_control.plants.plant import Reading


def contact_readings(wrenches: Mapping[str, Array]) -> dict[str, Reading]:
    """Return ``plant.contact.<name>.force`` and ``.moment`` for each contact.

    Args:
        wrenches: Of the world on the robot, in the world's axes, the moment about the
            origin of the contact's frame, shape (6,) each, by name.
    """
    readings: dict[str, Reading] = {}
    for name, wrench in wrenches.items():
        force = Reading(wrench[:3], "N", "of the world on the robot, in world axes")
        moment = Reading(wrench[3:], "N·m", "the same, about the frame's origin")
        readings[f"plant.contact.{name}.force"] = force
        readings[f"plant.contact.{name}.moment"] = moment
    return readings
