"""The columns of a log, allocated before the run."""

import math

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError

MAX_SIZE = 2_000_000_000
"""Most bytes of all columns: an hour at 1 kHz with 70 numbers per row."""


class LogColumns:
    """Columns for a known number of rows; what is not written is NaN."""

    def __init__(self, capacity: int) -> None:
        # the columns by name; each has a row for every row of the log
        self.arrays: dict[str, Array] = {}
        # the unit and the meaning of each, as JSON data
        self.descriptions: dict[str, dict[str, str]] = {}
        self.count = 0  # how many rows are complete
        self._capacity, self._size = capacity, 0

    def add(
        self, name: str, shape: tuple[int, ...], unit: str, meaning: str, **more: str
    ) -> None:
        """Add a column if it does not exist."""
        if name in self.arrays:
            return
        self._size += 8 * self._capacity * math.prod(shape)
        if self._size > MAX_SIZE:  # before memory is allocated
            raise SimulationError(
                f"a log of {self._capacity} rows is larger than {MAX_SIZE / 1e9:g} GB; "
                "choose a longer log_period or a shorter duration"
            )
        self.arrays[name] = np.full((self._capacity, *shape), np.nan)
        self.descriptions[name] = {"unit": unit, "meaning": meaning, **more}

    def rows(self, start: int = 0) -> dict[str, Array]:
        """Return views of the columns from a row to the last complete one."""
        return {name: array[start : self.count] for name, array in self.arrays.items()}

    def clear(self) -> None:
        """Remove all rows, to make room for new ones."""
        for array in self.arrays.values():
            array[: self.count] = np.nan
        self.count = 0
