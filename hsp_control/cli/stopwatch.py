"""The speed of a run's computation, and the size of its log."""

from time import perf_counter

from hsp_control.simulation import Rollout


class Stopwatch:
    """Measures the wall time from the first row on."""

    def __init__(self) -> None:
        self._first: float | None = None
        self._last = 0.0

    def lap(self) -> None:
        """Record the time of a row."""
        self._last = perf_counter()
        if self._first is None:
            self._first = self._last

    def table_rows(self, rollout: Rollout) -> list[tuple[str, str]]:
        """Return speed and size as rows of a table: name and text."""
        rows = len(rollout)
        size = sum(column.nbytes for column in rollout.columns.values())
        found = [
            ("log", f"{size / rows:.0f} bytes per row, {size / 1e6:.2g} MB in memory")
        ]
        took = 0.0 if self._first is None else self._last - self._first
        if rows > 1 and took > 0.0:
            simulated = float(rollout.t[-1] - rollout.t[0])
            found.insert(
                0,
                (
                    "speed",
                    f"{simulated / took:.3g} times real time ({simulated:g} s in "
                    f"{took:.2g} s, logging included)",
                ),
            )
        return found
