"""Designs: the choice of combinations of values."""

import math
from collections.abc import Sequence
from itertools import product
from typing import Any, Literal, get_args

import numpy as np

from hsp_control.common.errors import SweepError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.sweeps.factor import Factor
from hsp_control.companions.sweeps.values import quantiles

Design = Literal["grid", "random", "latin_hypercube", "sobol"]
"""All combinations; independent random values; values that cover each factor evenly;
values that cover all factors together evenly."""

MAX_RUNS = 1_000_000


def chosen_design(design: str | None, samples: int | None) -> Design:
    """Return the design: by default a grid, with samples a Latin hypercube."""
    if design is None:
        design = "grid" if samples is None else "latin_hypercube"
    if design not in get_args(Design):
        known = get_args(Design)
        raise SweepError(
            f"unknown design {design!r}{did_you_mean(design, known)} "
            f"(allowed: {listing(known)})"
        )
    if design == "grid" and samples is not None:
        raise SweepError(
            "a grid runs all combinations; remove --samples or choose another design"
        )
    if design != "grid" and samples is None:
        raise SweepError(f"the design {design} needs --samples")
    if samples is not None and not 1 <= samples <= MAX_RUNS:
        raise SweepError(f"{samples} samples; must be from 1 to {MAX_RUNS}")
    return design  # type: ignore[return-value]


def points(
    factors: Sequence[Factor], design: Design, samples: int | None, seed: int
) -> list[tuple[Any, ...]]:
    """Return every run's values, in the order of the factors."""
    if design == "grid":
        return _grid(factors)
    if seed < 0:
        raise SweepError(f"the seed is {seed}; must not be negative")
    assert samples is not None
    from scipy.stats import qmc  # here, because this import is slow

    rng = np.random.default_rng(seed)
    dimension = len(factors)
    if design == "random":
        fractions = rng.random((samples, dimension))
    elif design == "latin_hypercube":
        fractions = qmc.LatinHypercube(dimension, rng=rng).random(samples)
    else:
        # Balanced only for powers of two: draw the next power and drop the excess.
        exponent = (samples - 1).bit_length()
        fractions = qmc.Sobol(dimension, rng=rng).random_base2(exponent)[:samples]
    columns = [
        quantiles(factor.values, column)
        for factor, column in zip(factors, fractions.T, strict=True)
    ]
    return list(zip(*columns, strict=True))


def _grid(factors: Sequence[Factor]) -> list[tuple[Any, ...]]:
    lists: list[Sequence[Any]] = []
    for factor in factors:
        if isinstance(factor.values, Sequence):
            lists.append(factor.values)
        else:
            raise SweepError(
                f"{factor.origin}: a grid needs a list or a range with a count "
                "(1:10:5); or give --samples"
            )
    count = math.prod(map(len, lists))
    if count > MAX_RUNS:
        raise SweepError(f"the grid has {count} runs; at most {MAX_RUNS} are allowed")
    return list(product(*lists))
