"""A controller's memory of its run: one record, to which everything else is bound."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from copy import copy, deepcopy
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.actuation.sent_effort import SentMemory
from hsp_control.control.change import Change
from hsp_control.control.clock_check import ClockCheck
from hsp_control.control.clock_motion import ClockMotion
from hsp_control.trajectories.streams.run import StreamRun


class Waiting(NamedTuple):
    """An impedance that is not the planned one."""

    numbers: Array  # in force; see `Impedance.numbers`
    ramp: float  # duration of the change for which it waits [s]


@dataclass
class RunMemory:
    """The whole memory of a controller's run.

    A controller is its declaration, its time line, the state of its robot, and this.
    Calls read and write these arrays, and have no other memory. A copy
    and a pickle are of the four; a restart clears this one.
    """

    # of the last step, shape (nv,) [rad/s² or m/s²]
    acceleration: Array
    sent: SentMemory  # the efforts sent, and the effect of holding them
    # reading of the clock at time 0, shape (1,) [s], and whether that is known
    origin: Array = field(default_factory=lambda: np.zeros(1))
    counts: bool = False
    begun: bool = False  # whether there was a step
    now: float = -np.inf  # latest time of a step [s]
    # changes, as given, that no step has processed, and the time of the last one
    unseen: tuple[float, tuple[Change, ...]] = (-np.inf, ())
    # of tasks, by key: an impedance that waits, and the compensators' addition
    waiting: dict[int, Waiting] = field(default_factory=dict)
    offsets: dict[int, Array] = field(default_factory=dict)
    # compensators' part of commanded normal forces, by contact, shape (1,) [N]
    forces: dict[str, Array] = field(default_factory=dict)
    streams: tuple[StreamRun, ...] = ()  # of present and later references
    clock: ClockCheck = field(default_factory=ClockCheck)
    motion: ClockMotion = field(default_factory=ClockMotion)
    runs: int = 0  # how many times it was cleared

    @classmethod
    def of(cls, nv: int) -> "RunMemory":
        """Return the memory of a controller before its first run."""
        return cls(np.zeros(nv), SentMemory.of(nv))

    def clear(self) -> None:
        """Begin another run; the arrays stay where they are.

        So do the streams, until those of the new run take over their pending messages.
        """
        self.acceleration = np.zeros_like(self.acceleration)
        self.sent.clear()
        self.origin[:], self.counts = 0.0, False
        self.begun, self.now, self.unseen = False, -np.inf, (-np.inf, ())
        self.waiting.clear()
        for offset in (*self.offsets.values(), *self.forces.values()):
            offset[:] = 0.0
        self.clock, self.motion = ClockCheck(), ClockMotion()
        self.runs += 1

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Undo the effects of steps and sent efforts, at the time of the last one."""
        sent, waiting = deepcopy(self.sent), {**self.waiting}
        clock, motion = copy(self.clock), copy(self.motion)
        # of the last step, whose arrays the calls write
        last, now = self.acceleration.copy(), self.now
        try:
            yield
        finally:
            self.sent.become(sent)
            self.clock, self.motion = clock, motion
            self.acceleration, self.now = last, now
            self.waiting.clear()
            self.waiting.update(waiting)

    def follow(self, streams: Iterable[StreamRun]) -> None:
        """Remember the streams that are followed now, and forget those that are not.

        A new one takes over the messages of the previous one, of the same
        declaration, that were not read.
        """
        before, now = list(self.streams), list(streams)
        known = {id(each) for each in before}
        for run in now:
            if id(run) not in known:
                same = [each for each in before if each.declared is run.declared]
                if same:
                    run.follow(same[-1])
                before.append(run)
        self.streams = tuple(now)

    @property
    def queues(self) -> dict[int, Any]:
        """The memo of `deepcopy` for a copy that looks on: it reads these streams."""
        return {key: own for run in self.streams for key, own in run.shared.items()}

    def count_from(self, origin: float) -> None:
        """Count times from a reading of the clock [s]."""
        self.origin[0], self.counts = origin, True

    def force_offset(self, contact: str) -> Array:
        """Return the addition to a contact's commanded force; the array stays."""
        return self.forces.setdefault(contact, np.zeros(1))

    def made(self, now: float, change: Change) -> None:
        """Record a change that is made after a step at a time [s]."""
        before = self.unseen[1] if self.unseen[0] == now else ()
        self.unseen = now, (*before, change)

    def not_seen(self, now: float) -> tuple[Change, ...]:
        """Return the changes that were made after the last step, at a time [s]."""
        return self.unseen[1] if self.unseen[0] == now else ()
