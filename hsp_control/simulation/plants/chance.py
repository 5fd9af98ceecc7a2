"""Random numbers: each part has its own, so that one part more changes no other's."""

from typing import Protocol
from zlib import crc32

import numpy as np


class Seeded(Protocol):
    """A part with a seed."""

    @property
    def seed(self) -> int:
        """The seed."""
        ...


def generator(part: Seeded) -> np.random.Generator:
    """Return a fresh generator, by the part's seed and kind."""
    return np.random.default_rng([part.seed, crc32(type(part).__name__.encode())])
