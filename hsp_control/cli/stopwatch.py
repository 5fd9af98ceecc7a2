"""How fast a run was, and what a row of its log weighs."""

from time import perf_counter

from hsp_control.simulation import Rollout


class Stopwatch:
    """Measures a run from its first row on: kernels are compiled before that."""

    def __init__(self) -> None:
        """Wait for the first row."""
        self._first: float | None = None
        self._last = 0.0

    def lap(self) -> None:
        """Take the time of a row."""
        self._last = perf_counter()
        if self._first is None:
            self._first = self._last

    def told(self, rollout: Rollout) -> list[tuple[str, str]]:
        """Return what there is to say, as rows of a table."""
        rows = len(rollout)
        size = sum(column.nbytes for column in rollout.columns.values())
        told = [
            ("log", f"{size / rows:.0f} bytes a row, {size / 1e6:.2g} MB in memory")
        ]
        took = 0.0 if self._first is None else self._last - self._first
        if rows > 1 and took > 0.0:
            simulated = float(rollout.t[-1] - rollout.t[0])
            told.insert(
                0,
                (
                    "speed",
                    f"{simulated / took:.3g} times real time ({simulated:g} s in "
                    f"{took:.2g} s, logging included)",
                ),
            )
        return told
