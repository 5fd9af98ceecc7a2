"""Check g and g' of every field against differences, in every metric."""

import numpy as np
import pytest
from field_cases import FIELD_CASES, MEMBERS, draw, evaluate, every_field, metrics
from field_oracles import TIME, derivative, load, plain
from places import covering

from hsp_control.common.arrays import Array
from hsp_control.robot import differences

# --- the members ---------------------------------------------------------------------


@every_field
def test_value(name: str, which: str) -> None:
    """The value is the cost, the sum of costs, or the vector field's norm."""
    member = MEMBERS[which]
    q, v = draw(name, 1)
    field, state = member.build(name), load(name).state(TIME, q, v)
    value = field.value(state)
    expected = 0.0
    for weight, oracle, is_cost in member.parts(name):
        part = oracle(TIME, q)
        weight = weight(TIME, q) if callable(weight) else weight
        expected += weight * (part if is_cost else np.linalg.norm(part))
    assert isinstance(value, float)
    assert value == pytest.approx(expected, rel=1e-13, abs=1e-13)


@pytest.mark.parametrize(
    ("case", "metric_name"),
    covering(FIELD_CASES, ["identity", "constant", "mass matrix"]),
)
def test_field_and_its_rate(case: tuple[str, str], metric_name: str) -> None:
    """g = -W⁻¹∇f (or the vector itself), and g' its total derivative along the flow.

    Differences of eighth order give the gradient to 1e-13 of f, those of the package
    (`differences.gradient`) to 1e-12; W⁻¹ of a mass matrix amplifies both by 1e2.
    """
    name, which = case
    member = MEMBERS[which]
    robot = load(name)
    field = member.build(name)
    metric, W = metrics(robot)[metric_name]
    q, v = draw(name, 2)
    g, g_dot = evaluate(field, metric, robot.state(TIME, q, v))

    expected, lowered = np.zeros(robot.nv), 1.0
    for weight, oracle, is_cost in member.parts(name):
        weight = weight(TIME, q) if callable(weight) else weight
        if is_cost:
            slope = plain(name).gradient(oracle, TIME, q)
            expected -= weight * np.linalg.solve(W(q), slope)
            lowered += weight * (abs(oracle(TIME, q)) + np.abs(slope).max())
        else:
            expected += weight * oracle(TIME, q)
    lift = np.linalg.norm(np.linalg.inv(W(q)), 2)
    scale = lowered * max(1.0, lift)
    np.testing.assert_allclose(g, expected, rtol=0, atol=2e-12 * scale)

    def along(s: float) -> Array:
        state = robot.state(TIME + s, plain(name).moved(q, s * v), v)
        return evaluate(field, metric, state).g

    rate = derivative(along, 0.005)
    scale = scale + np.abs(rate).max()
    # The error of W⁻¹ times g, which may be far larger than g', over the step.
    rounding = 0.25 * np.finfo(float).eps * np.linalg.cond(W(q)) * np.abs(g).max()
    atol = member.rate_accuracy * scale + rounding / 0.005
    np.testing.assert_allclose(g_dot, rate, rtol=0, atol=atol)
    if member.parts(name) and metric_name != "identity":
        assert np.abs(g_dot).max() > 1e-3  # otherwise the test is void


# --- differences ---------------------------------------------------------------------


def test_rate_along_flow_of_anything() -> None:
    """Results as numbers, matrices or a state's arrays; in time at rest; fast
    motion."""
    robot, frame = load("panda"), "panda_tcp"
    q, v = draw("panda", 21)
    state = robot.state(TIME, q, v)
    at = state.frame(frame)
    found = differences.rate_along_flow(lambda s: s.frame(frame).jacobian, state)
    np.testing.assert_allclose(found, at.jacobian_dot, rtol=0, atol=1e-11)
    found = differences.rate_along_flow(lambda s: s.position(frame), state)
    np.testing.assert_allclose(found, at.velocity[:3], rtol=0, atol=1e-11)
    rest = robot.state(TIME, q, np.zeros(7))
    found = differences.rate_along_flow(lambda s: np.exp(s.t), rest)
    assert found == pytest.approx(np.exp(TIME), rel=1e-11)
    assert found.shape == ()
    fast = robot.state(TIME, q, 1e4 * v)
    found = differences.rate_along_flow(lambda s: s.position(frame), fast)
    expected = fast.frame(frame).velocity[:3]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * 1e4)
