"""Time and number of states that have a stamp but no number."""


class Stamps:
    """Numbers states by their stamps.

    The stamps of real robots jitter, so a step of less than one and a half periods is
    one state.

    Attributes:
        sequence: Number of the last state.
        last: Its stamp [ns]; None before the first.
    """

    def __init__(self, period: float) -> None:
        """Set the period [s]."""
        self._period = round(1e9 * period)
        self._origin = 0
        self.sequence = 0
        self.last: int | None = None

    @property
    def t(self) -> float:
        """Time of the last state since the origin [s]."""
        return 0.0 if self.last is None else 1e-9 * (self.last - self._origin)

    def begin(self, t: float) -> None:
        """Set the origin such that the last state is at a time [s]."""
        if self.last is not None:
            self._origin = self.last - round(1e9 * t)

    def take(self, stamp: int) -> bool:
        """Count a state; return False if it is not later than the last one."""
        if self.last is None:
            self._origin = self.last = stamp
            return True
        if stamp <= self.last:
            return False
        self.sequence += max(1, round((stamp - self.last) / self._period))
        self.last = stamp
        return True
