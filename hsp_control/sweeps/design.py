"""Designs: which combinations of values are run."""

import math
from collections.abc import Sequence
from itertools import product
from typing import Any, Literal, get_args

import numpy as np

from hsp_control.common.exceptions import SweepError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.sweeps.factor import Factor

Design = Literal["grid", "random", "latin_hypercube", "sobol"]
"""Every combination; independent draws; each factor evenly; all factors evenly."""

MAX_RUNS = 1_000_000


def chosen_design(design: str | None, samples: int | None) -> Design:
    """Return the design that is meant: without a number of samples, the grid.

    Raises:
        SweepError: If there is no such design, or a number of samples is missing or
            senseless.
    """
    if design is None:
        design = "grid" if samples is None else "latin_hypercube"
    if design not in get_args(Design):
        known = get_args(Design)
        raise SweepError(
            f"no design {design!r}{did_you_mean(design, known)} "
            f"(there are {listing(known)})"
        )
    if design == "grid" and samples is not None:
        raise SweepError(
            "a grid has as many runs as there are combinations: leave --samples out, "
            "or choose another design"
        )
    if design != "grid" and samples is None:
        raise SweepError(f"the design {design} needs a number of --samples")
    if samples is not None and not 1 <= samples <= MAX_RUNS:
        raise SweepError(f"{samples} samples; must be from 1 to {MAX_RUNS}")
    return design  # type: ignore[return-value]


def points(
    factors: Sequence[Factor], design: Design, samples: int | None, seed: int
) -> list[tuple[Any, ...]]:
    """Return every run's values, in the order of the factors.

    Args:
        factors: What is varied.
        design: See `Design`.
        samples: How many runs; None for a grid.
        seed: Of the random numbers: the same seed gives the same runs.

    Raises:
        SweepError: If a grid is asked of a distribution or has too many runs, or the
            seed is negative.
    """
    if design == "grid":
        return _grid(factors)
    if seed < 0:
        raise SweepError(f"the seed is {seed}; must not be negative")
    assert samples is not None
    from scipy.stats import qmc  # here: it takes longer to import than all else

    rng = np.random.default_rng(seed)
    dimension = len(factors)
    if design == "random":
        fractions = rng.random((samples, dimension))
    elif design == "latin_hypercube":
        fractions = qmc.LatinHypercube(dimension, rng=rng).random(samples)
    else:
        # Balanced only for powers of two: take the next one and leave the rest out.
        exponent = max(samples - 1, 0).bit_length()
        fractions = qmc.Sobol(dimension, rng=rng).random_base2(exponent)[:samples]
    return [
        tuple(
            factor.distribution.quantile(float(fraction))
            for factor, fraction in zip(factors, row, strict=True)
        )
        for row in fractions
    ]


def _grid(factors: Sequence[Factor]) -> list[tuple[Any, ...]]:
    lists = []
    for factor in factors:
        levels = factor.distribution.levels()
        if levels is None:
            raise SweepError(
                f"{factor.origin}: a grid needs a list or a range with a count "
                "(1:10:5), or give a number of --samples"
            )
        lists.append(levels)
    count = math.prod(map(len, lists))
    if count > MAX_RUNS:
        raise SweepError(f"the grid has {count} runs, more than {MAX_RUNS}")
    return list(product(*lists))
