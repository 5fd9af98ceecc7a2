"""The influence of parameters on metrics, from the runs of any design."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SweepError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.sweeps.results import Column, Sweep

MIN_RUNS = 8
"""Minimum number of completed runs; fewer correlate by chance."""

CHANCE = 0.05
"""Significance level: the probability that chance alone looks like an influence."""

_CLASSES = 12  # for a parameter with more values


@dataclass(frozen=True)
class Sensitivity:
    """The influence of a sweep's parameters on metrics.

    Attributes:
        parameters: Names of the p parameters that have more than one value.
        outcomes: Names of the m metrics.
        correlation: Spearman's rank correlation, shape (p, m): 1 if the metric always
            increases with the parameter, -1 if it always decreases; NaN if the
            parameter has no order (texts, lists) or the metric is constant.
        share: First-order share of the variance of the metric's ranks that the
            parameter explains alone, shape (p, m), from 0 (also if not significant) to
            1. It includes non-monotonic influences, such as an optimum in the middle.
            NaN if all values differ and have no order.
        noise: The |correlation| that chance alone exceeds with a probability of 5 %.
        runs: The number of completed runs.
    """

    parameters: tuple[str, ...]
    outcomes: tuple[str, ...]
    correlation: Array
    share: Array
    noise: float
    runs: int


def default_outcomes(sweep: Sweep) -> list[str]:
    """Return the most useful metrics: tracking, null space, distances, efforts."""
    wanted = [
        *(name for name in sweep.metrics if _is(name, "tracking.", ".rms")),
        "null_space_error.rms",
        "manipulability.min",
        *(name for name in sweep.metrics if _is(name, "distance.", ".min")),
        "effort.max",
    ]
    return [name for name in wanted if name in sweep and _known(sweep, name)]


def sensitivity(sweep: Sweep, outcomes: Sequence[str] | None = None) -> Sensitivity:
    """Return how metrics depend on parameters, over the completed runs.

    Ranks are compared, not values: errors and distances span orders of magnitude, and
    one run near a singularity would dominate all others.

    Args:
        sweep: The sweep.
        outcomes: Names of metrics; None: see `default_outcomes`.

    Raises:
        SweepError: If there is no such metric, or there are too few completed runs.
    """
    runs = int(sweep.completed.sum())
    if runs < MIN_RUNS:
        raise SweepError(
            f"{runs} runs were completed; sensitivities need at least {MIN_RUNS}"
        )
    return influences(sweep, outcomes)


def influences(sweep: Sweep, outcomes: Sequence[str] | None = None) -> Sensitivity:
    """Return the same for any number of runs: NaN and 0 if there are too few."""
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
    parameters = [p for p in sweep.parameters if len(set(sweep[p][chosen])) > 1]
    shape = (len(parameters), len(names))
    correlation, share = np.full(shape, np.nan), np.zeros(shape)
    for i, parameter in enumerate(parameters):
        x = sweep[parameter][chosen]
        for j, name in enumerate(names):
            y = sweep[name][chosen].astype(float)
            known = np.isfinite(y)
            if known.sum() >= MIN_RUNS:
                correlation[i, j], share[i, j] = _influence(x[known], y[known])
    noise = 1.96 / np.sqrt(max(runs - 1, 1))
    return Sensitivity(
        tuple(parameters), tuple(names), correlation, share, float(noise), runs
    )


def has_order(column: Column) -> bool:
    """Return whether a parameter's values have an order (numbers and booleans)."""
    return bool(np.issubdtype(column.dtype, np.number) or column.dtype == bool)


def _influence(x: Column, y: Array) -> tuple[float, float]:
    """Return rank correlation and explained share of one metric by one parameter."""
    from scipy import stats  # here, because this import is slow

    rank = stats.rankdata(y)
    if np.ptp(rank) == 0.0:
        return np.nan, 0.0
    if not has_order(x):
        kinds = np.unique(x.astype(str), return_inverse=True)[1]
        return np.nan, _explained(kinds, rank)
    order = stats.rankdata(x)
    if np.ptp(order) == 0.0:
        return np.nan, 0.0
    levels, classes = np.unique(order, return_inverse=True)
    if len(levels) > _CLASSES:
        count = min(_CLASSES, max(2, len(x) // 5))
        classes = ((order - 1.0) * count / len(x)).astype(int)
    return float(stats.spearmanr(x, y).statistic), _explained(classes, rank)


def _explained(classes: Column, rank: Array) -> float:
    """Return ε² = 1 - (within-class variance)/(variance), both unbiased.

    The correlation ratio η² alone is too large for small classes. So the result is 0 if
    an analysis of variance (here nearly the Kruskal-Wallis test) finds nothing.
    """
    from scipy import stats

    groups = [rank[classes == each] for each in np.unique(classes)]
    between, within = len(groups) - 1, len(rank) - len(groups)
    if within < 1 or between < 1:
        return np.nan
    if all(np.ptp(group) == 0.0 for group in groups):  # an infinite F
        return 1.0
    F, chance = stats.f_oneway(*groups)
    if chance > CHANCE:
        return 0.0
    return max(0.0, 1.0 - (len(rank) - 1) / (between * float(F) + within))


def _known(sweep: Sweep, name: str) -> bool:
    return bool(np.isfinite(sweep[name][sweep.completed]).any())


def _is(name: str, beginning: str, end: str) -> bool:
    return name.startswith(beginning) and name.endswith(end)
