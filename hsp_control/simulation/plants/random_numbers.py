"""Random numbers: each part has its own generator.

So adding a part does not change the random numbers of the others.
"""

from typing import Protocol
from zlib import crc32

import numpy as np


class Seeded(Protocol):
    """A sensor, drive or model change with a seed."""

    @property
    def seed(self) -> int:
        """The seed."""
        ...


def seeded_generator(part: Seeded) -> np.random.Generator:
    """Return a new generator, seeded by the part's seed and the name of its class."""
    return np.random.default_rng([part.seed, crc32(type(part).__name__.encode())])
