"""Common parts of benchmarks of random rollouts: their numbers, and two processes."""

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

import numpy as np
from rich.progress import track

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import RobotLimits

T = TypeVar("T")
STEP = 1e-3  # of the integrator [s]
PERIODS = (1e-3, 2e-3, 5e-3, 10e-3)  # for which an effort is held [s]
ROUNDING = 1e-9  # excess over a limit that is not regarded as a violation


def beyond(
    rollout: hsp.Rollout, limits: RobotLimits, period: float
) -> tuple[Array, ...]:
    """Return the excesses over the limits, by step and joint."""
    # Whatever is at -1: joints without a single coordinate have no limits.
    q = rollout["q"][:, limits.robot.dof_indices]
    v, tau = rollout["v"], rollout["tau"]
    return (
        np.abs(tau) - limits.effort,
        np.abs(np.diff(tau, axis=0)) / period - limits.effort_rate,
        np.abs(v) - limits.velocity,
        np.maximum(q - limits.upper, limits.lower - q),
    )


def run_parallel(work: Callable[[Any], T], items: Iterable[Any], what: str) -> list[T]:
    """Return ``work(item)`` for every item, computed by two processes."""
    items = list(items)
    with ProcessPoolExecutor(2) as pool:
        done = pool.map(work, items, chunksize=max(1, min(10, len(items) // 4)))
        return list(track(done, what, total=len(items), transient=True))
