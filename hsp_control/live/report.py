"""The result of a live run, with its response times and deadline misses."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.safe_stop import Phase

CAPACITY = 600_000
"""Number of periods whose times are stored, the latest ones: ten minutes at 1 kHz."""


class Quantiles(NamedTuple):
    """Quantiles of a distribution of times [s]."""

    median: float  # 50 % quantile
    p99: float  # 99 % quantile
    p999: float  # 99.9 % quantile
    worst: float  # maximum

    @classmethod
    def of(cls, times: Array) -> Self:
        """Return the quantiles of times [s], shape (N,); each is one of the times."""
        found = np.quantile(times, [0.5, 0.99, 0.999, 1.0], method="higher")
        return cls(*map(float, found))


class Deadlines:
    """Response times (state received to effort sent) and intervals between states.

    Counters and worst times cover the whole run, quantiles the last `CAPACITY` periods.

    Attributes:
        period: Length of a period, the deadline of a response [s].
        periods: Number of states that were answered with an effort.
        missed: Number of deadline misses: responses longer than a period.
        without_state: Number of periods in which no new state arrived.
        skipped_states: Number of states that the robot sent and the loop did not use.
    """

    def __init__(self, period: float, capacity: int = CAPACITY) -> None:
        """Allocate the memory and write to all of it, to avoid page faults later."""
        self.period = period
        self.periods = self.missed = self.without_state = self.skipped_states = 0
        self._responses: Array = np.full(capacity, np.nan)
        self._intervals: Array = np.full(capacity, np.nan)
        self._worst_response = self._worst_interval = 0.0

    def add(self, interval: float, response: float) -> None:
        """Record a period: from state to state, and from state to effort [s]."""
        k = self.periods % len(self._responses)
        self._responses[k], self._intervals[k] = response, interval
        self.periods += 1
        self.missed += response > self.period
        self._worst_response = max(self._worst_response, response)
        self._worst_interval = max(self._worst_interval, interval)

    @property
    def response(self) -> Quantiles | None:
        """Time from a state's arrival to its effort [s]; None before the first."""
        return self._quantiles(self._responses, self._worst_response)

    @property
    def interval(self) -> Quantiles | None:
        """Time between the arrivals of two states [s]; None before the first."""
        return self._quantiles(self._intervals, self._worst_interval)

    def _quantiles(self, times: Array, worst: float) -> Quantiles | None:
        if not self.periods:
            return None
        stored = Quantiles.of(times[: min(self.periods, len(times))])
        return stored._replace(worst=worst)


Ended = Literal["completed", "operator", "fault"]


@dataclass(frozen=True)
class LoopReport:
    """How a loop ended, and its response times.

    Attributes:
        ended: ``completed``: the duration is over, and the robot is at rest;
            ``operator``: the operator stopped it; ``fault``: a fault stopped it, or
            occurred in the safe stop, or the robot still moved afterwards.
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
        error: The exception of the controller, a change or the hardware that ended the
        run, if any.
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
    error: BaseException | None = None
    log: Path | None = None

    @property
    def status(self) -> str:
        """The status in the log: ``completed``, ``interrupted`` or ``stopped``."""
        words = {"operator": "interrupted", "fault": "stopped"}
        return words.get(self.ended, self.ended)
