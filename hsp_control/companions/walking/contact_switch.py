"""Switches of a plan: of a contact, and of the task that replaces it."""

from math import inf, nextafter

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.walking.written_part import Written
from hsp_control.control.interface import HELD
from hsp_control.declaration.quantities import Flag, NonNegative
from hsp_control.trajectories.schedule import Intervals, Schedule, smooth_step


class Switch(Written, Schedule):
    """w(t) in [0, 1] that a plan switches on and off, each with a ramp.

    Switched off, it is active until its ramp ends: the force of a contact fades before
    the contact ends. Switched on, it is active at once: the force of a contact rises
    from zero. A change during a ramp continues from the weight of that time.
    """

    intervals: Intervals = ((None, None),)
    """Not used: events determine when it is active."""
    ramp: NonNegative = 0.0
    """Not used: changes have their own."""
    on: Flag = True
    """Whether it is on before the first `set` [-]."""

    @property
    def constant(self) -> bool:
        """Whether it never changes: False."""
        return False

    def _unwritten(self) -> Array:
        weight = float(self.on)
        return np.array([-np.inf, 0.0, weight, weight])

    def set(self, on: bool, t: float, ramp: float = 0.0) -> None:
        """Switch it on or off, from a time on."""
        self.memory[:] = t, ramp, self.weight(t), float(on)

    def reset(self) -> None:
        """Return to the state before the first `set`."""
        self.memory[:] = self._unwritten()

    @property
    def _last(self) -> tuple[float, float, float, float]:
        """The last `set`: its time, its ramp [s], the weights before and after."""
        start, ramp, origin, target = self.memory.tolist()
        return start, ramp, origin, target

    @property
    def is_on(self) -> bool:
        """Whether it was last switched on, or is on from the beginning."""
        return bool(self.memory[3] > 0.0)

    def active(self, t: float) -> bool:
        """Return whether it is active at time t [s]."""
        start, ramp, _, target = self._last
        return target > 0.0 or t < start + ramp

    def edge(self, t: float) -> float:
        """Return a time just before or after the last `set` when it is inactive [s]."""
        start, ramp, _, target = self._last
        return nextafter(start, -inf) if target > 0.0 else start + ramp

    def weight(self, t: float) -> float:
        """Return w(t), t in s; in a ramp it is C² in t."""
        start, ramp, origin, target = self._last
        if t >= start + ramp:
            return target
        if t <= start:
            return origin
        return origin + (target - origin) * smooth_step(t, start, ramp)[0]


class Switched:
    """The switches of a contact and of the task that replaces it.

    One begins where the other ends, so that the law blends from one to the other while
    the force fades or rises; see `PlannedTask.weight_beyond`.
    """

    contact: Switch
    task: Switch | None  # moves its link

    def reset(self) -> None:
        """Return to the state before the first switch."""
        for switch in (self.contact, self.task):
            if switch is not None:
                switch.reset()

    def unload(self, t: float, ramp: float) -> None:
        """Fade the force from a time on [s]; then the task moves the link."""
        self.contact.set(False, t, ramp)
        if self.task is not None:
            self.task.set(True, t + ramp)

    def lift(self, t: float) -> None:
        """Activate the task, which moves the link, now [s]."""
        self.unload(t, 0.0)

    def set_down(self, t: float, ramp: float) -> None:
        """Raise the force from now on [s], while the task ends."""
        if self.task is not None:
            self.task.set(True, t)  # it may wait for the end of a ramp
            self.task.set(False, t)
        self.contact.set(True, t, ramp)

    def rests(self, t: float) -> bool:
        """Return whether the contact alone is active at t [s], and its task ends."""
        return self.contact.is_on and self.contact.weight(t) >= HELD
