"""A contact that a plan switches, and the task that moves its link meanwhile."""

from hsp_control.control.planned_contact import HELD
from hsp_control.trajectories.switch import Switch


class Switched:
    """The switches of a contact and of the task that takes its place.

    Each begins where the other ends, so that the law goes over from one to the other
    while the force fades or rises; see `PlannedTask.weight_beyond`.
    """

    contact: Switch
    task: Switch | None  # that moves its link

    def reset(self) -> None:
        """Return to the state before the first switch."""
        for switch in (self.contact, self.task):
            if switch is not None:
                switch.reset()

    def unload(self, t: float, ramp: float) -> None:
        """Let the force fade from a time on [s]; then the task moves the link."""
        self.contact.throw(False, t, ramp)
        if self.task is not None:
            self.task.throw(True, t + ramp)

    def lift(self, t: float) -> None:
        """Let the task move the link now [s]."""
        self.unload(t, 0.0)

    def bear(self, t: float, ramp: float) -> None:
        """Let the force rise from now on [s], while the task ends."""
        if self.task is not None:
            self.task.throw(True, t)  # it may wait for the end of a ramp
            self.task.throw(False, t)
        self.contact.throw(True, t, ramp)

    def rests(self, t: float) -> bool:
        """Return whether the contact alone counts at time t [s], and its task ends."""
        return self.contact.is_on and self.contact.weight(t) >= HELD
