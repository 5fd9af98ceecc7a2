"""Changes of contacts while a controller runs."""

from dataclasses import replace
from typing import Self

from hsp_control.common.exceptions import ContactError
from hsp_control.constraints.contacts import CommandedForce
from hsp_control.control.change import Change
from hsp_control.control.setup import Setup
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Flag
from hsp_control.geometry.start import Start
from hsp_control.trajectories import Crossfade


class ChangeContact(Change, type="contact"):
    """A contact is lifted, or set down again; its force fades.

    While the force is less than a tenth, the motion that the contact stops is set free,
    or stopped, in proportion.
    """

    contact: str
    """Name of the contact."""
    bears: Flag
    """Whether it bears from then on."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the contact; see `Change.apply`."""
        planned = setup.contact(self.contact)
        presence = planned.presence.then(self.at, self.ramp, float(self.bears))
        return setup.with_contact(planned, presence=presence)


class ChangeForce(Change, type="force"):
    """The commanded force of a contact changes to another one; C² if both are."""

    contact: str
    """Name of the contact."""
    force: CommandedForce
    """The new command, with as many coordinates as the old one."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change, checked where the robot is."""
        contact = setup.contact(self.contact).contact
        replace(contact, force=self.force).placed(start)
        return self

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the force; see `Change.apply`."""
        planned = setup.contact(self.contact)
        contact = planned.contact
        old, new = contact.force, self.force
        with within("force"):
            if old is None:
                raise ContactError(
                    f"contact {self.contact!r} has no commanded force from the start, "
                    "so none can follow; give it one, for example {value: 0}"
                )
            if old.dimension != new.dimension:
                raise ContactError(
                    f"it has {new.dimension} coordinates; the force of contact "
                    f"{self.contact!r} has {old.dimension}"
                )
        changed = Crossfade(
            old.followed, new.followed, start_time=self.at, duration=self.ramp
        )
        following = replace(contact, force=CommandedForce(trajectory=changed))
        return setup.with_contact(planned, contact=following)
