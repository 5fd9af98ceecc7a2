"""The time since another process last gave a sign of life."""

_LOOK = 0.1
"""Longest time between two checks that is added [s]: this process may stall, too."""


class Silence:
    """The time without a sign, less the time for which this process was suspended."""

    def __init__(self, now: float) -> None:
        """Begin at a time [s]."""
        self._looked, self._lasts = now, 0.0

    def look(self, now: float, *, received: bool) -> float:
        """Return this time [s].

        Args:
            now: The time of this look [s].
            received: Whether a message arrived since the last look.
        """
        self._lasts = 0.0 if received else self._lasts + min(now - self._looked, _LOOK)
        self._looked = now
        return self._lasts
