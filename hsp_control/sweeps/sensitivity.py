"""Which parameter moves which result, from the runs of any design."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SweepError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.sweeps.results import Column, Sweep

LEAST_RUNS = 8
"""Completed runs below which nothing is said: chance alone correlates so few."""

CHANCE = 0.05
"""How likely chance alone may be to look like what counts as an influence."""

_CLASSES = 12  # into which a parameter with more values is cut


@dataclass(frozen=True)
class Sensitivity:
    """What the runs of a sweep tell of each parameter's influence on each result.

    Attributes:
        parameters: Names of p parameters, those that took more than one value.
        outcomes: Names of m results.
        correlation: Spearman's rank correlation, shape (p, m): 1 where the result grows
            whenever the parameter does, -1 where it falls; NaN where the parameter has
            no order (texts, lists) or the result does not vary.
        share: First-order share of the result's variance (of its ranks) that the
            parameter explains alone, in any form, also where it has an optimum in the
            middle, shape (p, m): 0, where it may be chance, to 1; NaN where all values
            differ and have no order.
        noise: What |correlation| chance alone exceeds in one of twenty cases.
        runs: How many completed runs it is made of.
    """

    parameters: tuple[str, ...]
    outcomes: tuple[str, ...]
    correlation: Array
    share: Array
    noise: float
    runs: int


def default_outcomes(sweep: Sweep) -> list[str]:
    """Return the results that one asks for first: tracking, null space, distances."""
    wanted = [
        *(name for name in sweep.metrics if _is(name, "tracking.", ".rms")),
        "null_space_error.rms",
        "manipulability.min",
        *(name for name in sweep.metrics if _is(name, "distance.", ".min")),
        "effort.max",
    ]
    return [name for name in wanted if name in sweep and _known(sweep, name)]


def sensitivity(sweep: Sweep, outcomes: Sequence[str] | None = None) -> Sensitivity:
    """Return how results depend on parameters, over the completed runs.

    Ranks are compared, not values: errors and distances span decades, and one run near
    a singularity would outweigh all others.

    Args:
        sweep: The sweep.
        outcomes: Names of metrics; None: see `default_outcomes`.

    Raises:
        SweepError: If there is no such metric, or too few runs were completed.
    """
    names = default_outcomes(sweep) if outcomes is None else list(outcomes)
    for name in names:
        if name not in sweep.metrics:
            raise SweepError(
                f"the sweep has no metric {name!r}{did_you_mean(name, sweep.metrics)} "
                f"(it has {listing(sweep.metrics, 40)})"
            )
        if not _known(sweep, name):
            raise SweepError(f"no completed run has the metric {name!r}")
    chosen = sweep.completed
    runs = int(chosen.sum())
    if runs < LEAST_RUNS:
        raise SweepError(
            f"{runs} runs were completed; sensitivities need at least {LEAST_RUNS}"
        )
    parameters = [p for p in sweep.parameters if len(set(sweep[p][chosen])) > 1]
    shape = (len(parameters), len(names))
    correlation, share = np.full(shape, np.nan), np.zeros(shape)
    for i, parameter in enumerate(parameters):
        x = sweep[parameter][chosen]
        for j, name in enumerate(names):
            y = sweep[name][chosen].astype(float)
            known = np.isfinite(y)
            if known.sum() >= LEAST_RUNS:
                correlation[i, j], share[i, j] = _influence(x[known], y[known])
    noise = 1.96 / np.sqrt(runs - 1)
    return Sensitivity(
        tuple(parameters), tuple(names), correlation, share, float(noise), runs
    )


def has_order(column: Column) -> bool:
    """Return whether a parameter's values are numbers, which one can be more of."""
    return bool(np.issubdtype(column.dtype, np.number) or column.dtype == bool)


def _influence(x: Column, y: Array) -> tuple[float, float]:
    """Return rank correlation and explained share of one result by one parameter."""
    from scipy.stats import rankdata  # here: it takes longer to import than all else

    rank = rankdata(y)
    if np.ptp(rank) == 0.0:
        return np.nan, 0.0
    if not has_order(x):
        return np.nan, _explained(
            np.unique(x.astype(str), return_inverse=True)[1], rank
        )
    order = rankdata(x)
    if np.ptp(order) == 0.0:
        return np.nan, 0.0
    levels = np.unique(order)
    classes = np.searchsorted(levels, order)
    if len(levels) > _CLASSES:
        count = min(_CLASSES, max(2, len(x) // 5))
        classes = ((order - 1.0) * count / len(x)).astype(int)
    return float(np.corrcoef(order, rank)[0, 1]), _explained(classes, rank)


def _explained(classes: Column, rank: Array) -> float:
    """Return ε² = 1 - (within-class variance)/(variance), both without bias.

    The correlation ratio η² alone would call chance an influence where classes are
    small; what an F test (here nearly Kruskal and Wallis's) does not tell from chance
    counts as nothing.
    """
    count = np.bincount(classes)
    means = np.bincount(classes, rank) / np.maximum(count, 1)
    groups = int((count > 0).sum())
    dofs = len(rank) - groups
    if dofs < 1 or groups < 2:
        return np.nan
    within = float(((rank - means[classes]) ** 2).sum()) / dofs
    between = float((count * (means - rank.mean()) ** 2).sum()) / (groups - 1)
    if within > 0.0 and fdtrc(groups - 1, dofs, between / within) > CHANCE:
        return 0.0
    return max(0.0, 1.0 - within / float(np.var(rank, ddof=1)))


def _known(sweep: Sweep, name: str) -> bool:
    return bool(np.isfinite(sweep[name][sweep.completed]).any())


def _is(name: str, beginning: str, end: str) -> bool:
    return name.startswith(beginning) and name.endswith(end)
