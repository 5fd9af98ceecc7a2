"""Runs of a sampled or continuous loop, and the propositions as checks of logs."""

from typing import Any

import numpy as np
from numpy.testing import assert_allclose

import hsp_control as hsp
from hsp_control.robot.integrators import Dop853, Rk4


def held(law: hsp.Controller, q0: Any, period: float = 1e-3, **how: Any) -> hsp.Rollout:
    """Run a sampled loop with a row per period, in steps of at most 1 ms."""
    settings = {"log_period": period, "integrator": Rk4(min(period, 1e-3))} | how
    return hsp.simulate(law, q0, control_period=period, **settings)


def continuous(
    law: hsp.Controller, q0: Any, v0: Any = None, tolerance: float = 1e-10, **how: Any
) -> hsp.Rollout:
    """Run the continuous loop of the proofs."""
    precise = Dop853(rtol=tolerance, atol=tolerance)
    return hsp.simulate(law, q0, v0, integrator=precise, **how)


def check_errors(log: hsp.Rollout, w: float, *tasks: str, atol: float) -> None:
    """Check e'' + 2w e' + w² e = 0, for the errors of tasks."""
    t = log.t[:, None]
    for name in tasks:
        e, rate = log[f"task.{name}.error"], log[f"task.{name}.error_rate"][0]
        expected = np.exp(-w * t) * (e[0] + (rate + w * e[0]) * t)
        assert_allclose(e, expected, rtol=0, atol=atol)


def check_null_space(
    log: hsp.Rollout, K_N: float, *, least: float, rtol: float
) -> None:
    """Check ‖e_N‖' = -K_N ‖e_N‖, from a norm above rounding."""
    norm = log["null_space_norm"]
    assert norm[0] > least
    assert_allclose(norm, norm[0] * np.exp(-K_N * log.t), rtol=rtol)
