"""Metrics: the mass matrix, and refused constant ones."""

from typing import Any

import numpy as np
import oracles
import pytest
from hypothesis import given
from hypothesis import strategies as st
from law_cases import load
from wording import wording

from hsp_control import Cost, RobotState, TargetPosture
from hsp_control.common.errors import MetricError
from hsp_control.geometry import Scene
from hsp_control.geometry.scene import Start
from hsp_control.null_space.fields import FieldSample
from hsp_control.null_space.metrics import (
    ConstantMetric,
    CoordinatesMetric,
    MassMatrixMetric,
    MetricSample,
)

seeds = st.integers(0, 2**32 - 1)


def test_the_mass_matrix_over_the_robots_own_inertia() -> None:
    """P is that of M itself; a descent is faster in proportion to the inertia."""
    robot, rng = load("panda"), np.random.default_rng(32)
    state = robot.state(0.0, robot.random_configuration(rng), rng.standard_normal(7))
    metric = MassMatrixMetric(inertia="robot").placed(Start(state, Scene()))
    inertia = robot.typical_inertia
    assert metric.inertia == inertia == pytest.approx(0.325, abs=1e-3)
    assert metric.inertia**7 == pytest.approx(robot.largest_inertias.prod())
    scaled = metric.evaluate(state, MetricSample.allocate(7))
    compiled = MetricSample.allocate(7)
    state.run(metric.calls(state, compiled))
    plain = MassMatrixMetric().evaluate(state, MetricSample.allocate(7))
    for part, same, whole in zip(scaled, compiled, plain, strict=True):
        np.testing.assert_allclose(part, same, rtol=1e-14, atol=1e-16)
        factor = np.sqrt(inertia) if part is scaled.L else inertia
        np.testing.assert_allclose(part * factor, whole, rtol=1e-13, atol=1e-15)


def test_natural_gradient_descends_where_the_plain_one_need_not() -> None:
    """f' = -‖P W⁻¹∇f‖²_W along v = P g for g = -W⁻¹∇f; with g = -∇f it may rise."""
    robot = load("panda")
    frame = "panda_tcp"
    rng = np.random.default_rng(31)
    cost: Cost = TargetPosture(robot.home())
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
    assert rises > 10  # of 200: why gradients are multiplied by W⁻¹


@pytest.mark.parametrize(
    ("W", "message"),
    [
        (np.ones((2, 3)), "ConstantMetric: ... (2, 3)"),
        (2.0, "ConstantMetric: matrix: 2.0 ... a list"),
        ([], "ConstantMetric: matrix: [] ... 0 ... at least 1"),
        (np.ones((2, 2, 2)), "ConstantMetric: matrix.0.0: ... a number"),
        ([1.0, np.nan], "ConstantMetric: matrix.1: nan ... finite"),
        ([[1.0, 2.0], [0.0, 1.0]], "ConstantMetric: the metric is not symmetric"),
        ([[1.0, 2.0], [0.0]], "... different lengths [1, 2]"),
        ([1.0, [2.0]], "ConstantMetric: matrix: mixes numbers and rows"),
        ([1.0, -1.0], "... positive definite ... -1"),
        ([1.0, 1e-13], "... positive definite ... 1e-13"),
    ],
)  # fmt: skip
def test_constant_metric_refuses(W: Any, message: str) -> None:
    with pytest.raises(MetricError, match=wording(message)):
        ConstantMetric(W)


@given(seeds, st.integers(2, 8))
def test_coordinates_that_are_singular_but_for_rounding(seed: int, n: int) -> None:
    """AᵀA of a singular A has a smallest eigenvalue of ±1e-16, of either sign."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n - 1)) @ rng.standard_normal((n - 1, n))
    with pytest.raises(MetricError, match="not positive definite"):
        CoordinatesMetric(A)
    with pytest.raises(
        MetricError, match=r"the coordinates have shape .*; need \(nv, nv\)"
    ):
        CoordinatesMetric(A[:, 1:])


def test_coordinates_of_the_robot_s_source() -> None:
    """θ = A q of the planar arm are the absolute angles of its links."""
    robot = load("planar3r")
    start = Start(robot.state(0.0, robot.home(), np.zeros(3)), Scene())
    A = robot.joint_coordinates
    assert A is not None
    metric = CoordinatesMetric().placed(start)
    assert metric == CoordinatesMetric(A)
    assert metric.placed(start) == metric
    np.testing.assert_array_equal(metric.W, A.T @ A)
    np.testing.assert_array_equal(metric.W[0], [3.0, 2.0, 1.0])
    with pytest.raises(MetricError, match="place the metric"):
        CoordinatesMetric().evaluate(start.state, MetricSample.allocate(3))


def test_a_metric_s_own_evaluate_is_compiled() -> None:
    """A step calls the methods that a subclass overrides in plain Python."""

    class Halved(ConstantMetric):
        """Half of a matrix."""

        def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
            super().evaluate(state, out)
            out.W[:] *= 0.5
            return out

    robot = load("panda")
    state, out = robot.state(0.0, robot.home(), np.zeros(7)), MetricSample.allocate(7)
    state.run(Halved(np.full(7, 3.0)).calls(state, out))
    np.testing.assert_array_equal(out.W, 1.5 * np.eye(7))
