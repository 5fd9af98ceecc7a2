"""Gains by task name, as a part may hold them."""

from collections.abc import Iterator, Mapping

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.declaration.equality import same


class GainsByTask(Mapping[str, Array]):
    """Gains by task name; they never change."""

    def __init__(self, gains: Mapping[str, Array] | None = None) -> None:
        """Copy the mapping, not its arrays, which are read-only."""
        self._gains = dict(gains or {})

    def __getitem__(self, task: str) -> Array:
        return self._gains[task]

    def __iter__(self) -> Iterator[str]:
        return iter(self._gains)

    def __len__(self) -> int:
        return len(self._gains)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mapping) and same(self._gains, dict(other))

    def __hash__(self) -> int:
        gains = self._gains.items()
        return hash(frozenset((k, g.shape, (g + 0.0).tobytes()) for k, g in gains))

    def __repr__(self) -> str:
        return repr({k: np.asarray(g).tolist() for k, g in self._gains.items()})

    def __setstate__(self, state: dict[str, dict[str, Array]]) -> None:
        for gain in state["_gains"].values():
            gain.setflags(write=False)  # pickle forgets it
        vars(self).update(state)
