"""How late a live loop was."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.latency import Quantiles

KEPT = 600_000
"""Periods whose times are kept, the latest: ten minutes at 1 kHz."""


class Deadlines:
    """Times from a state's arrival to its effort, and between arrivals.

    Counts and worst times are of the whole run, quantiles of its last `KEPT` periods.

    Attributes:
        period: Length of a period [s].
        periods: How many states were answered.
        missed: How many answers took longer than a period.
        silent: Periods in which no new state came.
        unseen: States that the robot made and the loop did not see.
    """

    def __init__(self, period: float, kept: int = KEPT) -> None:
        """Allocate, and touch every page of it: the loop shall find it in memory."""
        self.period = period
        self.periods = self.missed = self.silent = self.unseen = 0
        self._responses: Array = np.full(kept, np.nan)
        self._gaps: Array = np.full(kept, np.nan)
        self._worst_response = self._worst_gap = 0.0

    def add(self, gap: float, response: float) -> None:
        """Note a period.

        Args:
            gap: Time since the last state's arrival [s].
            response: Time from this state's arrival until its effort was sent [s].
        """
        k = self.periods % len(self._responses)
        self._responses[k], self._gaps[k] = response, gap
        self.periods += 1
        self.missed += response > self.period
        self._worst_response = max(self._worst_response, response)
        self._worst_gap = max(self._worst_gap, gap)

    @property
    def response(self) -> Quantiles | None:
        """From a state's arrival to its effort [s]; None without any."""
        return self._quantiles(self._responses, self._worst_response)

    @property
    def gap(self) -> Quantiles | None:
        """Between the arrivals of two states [s]; None without any."""
        return self._quantiles(self._gaps, self._worst_gap)

    def _quantiles(self, times: Array, worst: float) -> Quantiles | None:
        if not self.periods:
            return None
        found = Quantiles.of(times[: min(self.periods, len(times))])
        return found._replace(worst=worst)
