"""Random numbers: each part of a plant has its own generator.

So adding a part does not change the random numbers of the others.
"""

from zlib import crc32

import numpy as np


def seeded_generator(seed: int, name: str) -> np.random.Generator:
    """Return a new generator for a plant's seed and the name of the part's class."""
    return np.random.default_rng([seed, crc32(name.encode())])
