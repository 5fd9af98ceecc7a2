"""Check the metrics: the mass matrix, and which constant ones are refused."""

from typing import Any

import numpy as np
import oracles
import pytest
from hypothesis import given
from hypothesis import strategies as st
from law_cases import load

from hsp_control import (
    ConstantMetric,
    Cost,
    MassMatrixMetric,
    TargetPosture,
)
from hsp_control.common.exceptions import MetricError
from hsp_control.null_space.fields import FieldSample
from hsp_control.null_space.metrics import MetricSample

seeds = st.integers(0, 2**32 - 1)


def test_mass_matrix_metric() -> None:
    robot = load("panda")
    rng = np.random.default_rng(30)
    state = robot.state(0.0, robot.random_configuration(rng), rng.standard_normal(7))
    sample = MassMatrixMetric().evaluate(state, MetricSample.allocate(7))
    np.testing.assert_array_equal(sample.W, state.mass_matrix)
    np.testing.assert_array_equal(sample.W_dot, state.mass_matrix_rate)
    np.testing.assert_allclose(sample.L @ sample.L.T, sample.W, rtol=0, atol=1e-15)


def test_natural_gradient_descends_where_the_plain_one_need_not() -> None:
    """f' = -‖P W⁻¹∇f‖²_W along v = P g for g = -W⁻¹∇f; with g = -∇f it may rise."""
    robot = load("panda")
    frame = "panda_tcp"
    rng = np.random.default_rng(31)
    cost: Cost = TargetPosture(robot, robot.home())
    metric = MassMatrixMetric()
    rises = 0
    for _ in range(200):
        q = robot.random_configuration(rng)
        state = robot.state(0.0, q, np.zeros(7))
        sample = metric.evaluate(state, MetricSample.allocate(7))
        field = cost.evaluate(state, sample, metric.form, FieldSample.allocate(7))
        gradient = cost.gradient(state)
        J = state.frame(frame).jacobian[:3]
        P = np.eye(7) - oracles.pseudo_inverse(J, sample.W) @ J
        v = P @ field.g
        np.testing.assert_allclose(gradient @ v, -v @ sample.W @ v, rtol=1e-9)
        assert gradient @ v < 0.0
        rises += bool(gradient @ P @ -gradient > 0.0)
    assert rises > 10  # of 200: the reason for raising with the metric


@pytest.mark.parametrize(
    ("W", "message"),
    [
        (np.zeros((2, 3)), r"metric has shape \(2, 3\); needs \(nv, nv\)"),
        (2.0, r"metric has shape \(\)"),
        ([], r"metric has shape \(0, 0\)"),
        (np.zeros((2, 2, 2)), r"metric has shape \(2, 2, 2\)"),
        ([1.0, np.nan], "metric contains NaN or inf"),
        ([1.0, np.inf], "metric contains NaN or inf"),
        ([[1.0, 2.0], [0.0, 1.0]], "metric is not symmetric"),
        ([1.0, -1.0], "not positive definite: its smallest eigenvalue is -1"),
        ([1.0, 0.0], "not positive definite: its smallest eigenvalue is 0"),
        (-np.eye(3), "not positive definite: its smallest eigenvalue is -1"),
        (np.ones((3, 3)), "not positive definite"),
    ],
)
def test_constant_metric_refuses(W: Any, message: str) -> None:
    with pytest.raises(MetricError, match=message):
        ConstantMetric(W)


@given(seeds, st.integers(2, 8))
def test_coordinates_that_are_singular_but_for_rounding(seed: int, n: int) -> None:
    """AᵀA of a singular A has a least eigenvalue of ±1e-16, by the toss of a coin."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n - 1)) @ rng.standard_normal((n - 1, n))
    with pytest.raises(MetricError, match="not positive definite"):
        ConstantMetric.from_coordinates(A)
    with pytest.raises(
        MetricError, match=r"coordinates A have shape .*; need \(nv, nv\)"
    ):
        ConstantMetric.from_coordinates(A[:, 1:])


def test_constant_metric_keeps_a_copy() -> None:
    W = np.eye(3)
    metric = ConstantMetric(W)
    W[:] = 0.0
    np.testing.assert_array_equal(metric.W, np.eye(3))
    np.testing.assert_array_equal(ConstantMetric([1.0, 2.0]).W, np.diag([1.0, 2.0]))
