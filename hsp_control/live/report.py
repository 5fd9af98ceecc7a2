"""What became of a live run."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from hsp_control.live.deadlines import Deadlines
from hsp_control.live.safe_stop import Phase

Ended = Literal["completed", "operator", "fault"]


@dataclass(frozen=True)
class LoopReport:
    """How a loop ended, and how punctual it was.

    Attributes:
        ended: ``completed``: its time was over; ``operator``: somebody stopped it;
            ``fault``: something was wrong.
        reason: What ended it, in a sentence.
        phase: Where the safe stop got: `Phase.HOLDING` once the robot stood still, or
            `Phase.DAMPING` if the loop fell silent before, blind or interrupted.
        silent: Whether it fell silent before the stop was over: the robot's own
            watchdog then has to stop it.
        speed: The fastest joint's speed at the end, measured or reckoned.
        t: The run's time at the end [s].
        deadlines: How late it was.
        error: What the controller, a change or the hardware raised, if that ended it.
        log: The journal, if one was written.
    """

    ended: Ended
    reason: str
    phase: Phase
    silent: bool
    speed: float
    t: float
    deadlines: Deadlines
    error: Exception | None = None
    log: Path | None = field(default=None)

    @property
    def status(self) -> str:
        """What the log says: ``completed``, ``interrupted`` or ``stopped``."""
        words = {"operator": "interrupted", "fault": "stopped"}
        return words.get(self.ended, self.ended)
