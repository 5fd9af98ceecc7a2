"""The decay of the null-space error that the law predicts, computed from a log."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import constant_metric

ROUNDING = 1e-12
"""Ratio of ‖e_N(0)‖ to the speeds it is computed from, below which it is rounding."""


class Decay(NamedTuple):
    """The prediction of ‖e_N‖_W, or the reason why there is none."""

    slow: Array | None  # upper bound, shape (N,); None without a prediction
    fast: Array | None  # lower bound, shape (N,); the same array for a scalar gain
    gains: tuple[float, float]  # the rates of the upper and the lower bound [1/s]
    why_not: str  # why there is no prediction; "" if there is one


def predicted_decay(rollout: Rollout) -> Decay:
    """Return ‖e_N(0)‖_W exp(-K_N t), or bounds for a matrix K_N.

    ``docs/law.md``, Equations (7) and (13) over a metric, Proposition 2.
    V' = -e_NᵀW K_N e_N lies between -2V times the largest and -2V times the smallest
    eigenvalue of the symmetric part of W K_N relative to W.
    """
    if not rollout.meta.get("controls_null_space", True):
        why = "no prediction: self-motion is not controlled"
        return Decay(None, None, (0.0, 0.0), why)
    gain = rollout.meta.get("null_space_gain")
    if gain is None:
        why = "no prediction: $K_N$ not in the log"
        return Decay(None, None, (0.0, 0.0), why)
    K_N = np.asarray(gain, dtype=float)
    multiple = K_N[0, 0] * np.eye(len(K_N))
    scalar = np.array_equal(K_N, multiple)
    W = np.eye(len(K_N)) if scalar else constant_metric(rollout)
    if W is None:
        why = "no prediction: $K_N$ is a matrix, $W$ not in the log"
        return Decay(None, None, (0.0, 0.0), why)
    power = 0.5 * (W @ K_N + (W @ K_N).T)
    from scipy.linalg import eigh  # here: SciPy takes long to import

    rates = eigh(power, W, eigvals_only=True)
    slowest, fastest = float(rates[0]), float(rates[-1])
    norm, elapsed = rollout["null_space_norm"], rollout.t - rollout.t[0]
    speeds = np.linalg.norm(rollout["field.g"], axis=1)
    speeds = speeds + np.linalg.norm(rollout.v, axis=1)
    if not norm[0] > ROUNDING * float(speeds.max()):
        why = "no prediction: starts with $e_N$ = 0"
        return Decay(None, None, (slowest, fastest), why)
    slow = norm[0] * np.exp(-slowest * elapsed)
    fast = slow if scalar else norm[0] * np.exp(-fastest * elapsed)
    return Decay(slow, fast, (slowest, fastest), "")
