"""A contact, and when it is part of a controller."""

from dataclasses import dataclass

from hsp_control.constraints.contacts import Contact
from hsp_control.control.evolution import PRESENT, Evolution


@dataclass(frozen=True)
class PlannedContact:
    """A contact, and when it is part of the controller.

    Attributes:
        contact: The contact.
        presence: 1 while it bears, 0 while it is lifted.
    """

    contact: Contact
    presence: Evolution[float]

    @property
    def always(self) -> bool:
        """Whether the contact bears at all times."""
        return self.contact.always and self.presence == PRESENT

    def active(self, t: float) -> bool:
        """Return whether the contact is kept at rest at time t [s]."""
        return self.contact.active(t) and (
            self.presence == PRESENT or self.presence.at(t) > 0.0
        )

    def weight(self, t: float) -> float:
        """Return how much it bears at time t [s], in [0, 1]."""
        return self.contact.weight(t) * self.presence.at(t)
