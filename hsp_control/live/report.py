"""The result of a live run."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from hsp_control.live.deadlines import Deadlines
from hsp_control.live.safe_stop import Phase

Ended = Literal["completed", "operator", "fault"]


@dataclass(frozen=True)
class LoopReport:
    """How a loop ended, and its response times.

    Attributes:
        ended: ``completed``: the duration is over, and the robot is at rest;
            ``operator``: the operator stopped it; ``fault``: a fault stopped it, or
            came in the safe stop, or the robot still moved afterwards.
        reason: Why it ended, in a sentence.
        phase: The last phase of the safe stop: `Phase.HOLDING` if the safe stop ended,
            `Phase.DAMPING` if the loop fell silent before.
        silent: Whether the loop fell silent, that is stopped sending efforts, before
            the safe stop was complete: the robot's own watchdog must stop it.
        speed: Speed of the fastest joint at the end, measured or predicted.
        at_rest: Whether this speed is at most `StopSettings.standstill`, and the safe
            stop has ended.
        t: The run's time at the end [s].
        deadlines: Response times and deadline misses.
        error: What the controller, a change or the hardware raised, if it ended the
            run.
        log: The journal, if one was written.
    """

    ended: Ended
    reason: str
    phase: Phase
    silent: bool
    speed: float
    at_rest: bool
    t: float
    deadlines: Deadlines
    error: Exception | None = None
    log: Path | None = None

    @property
    def status(self) -> str:
        """The status in the log: ``completed``, ``interrupted`` or ``stopped``."""
        words = {"operator": "interrupted", "fault": "stopped"}
        return words.get(self.ended, self.ended)
