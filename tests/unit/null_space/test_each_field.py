"""Check what each field promises by itself, and sums of fields."""

from typing import Any

import numpy as np
import pytest
from field_cases import draw, evaluate, metrics
from field_oracles import (
    JOINTS,
    OBSTACLE,
    TIME,
    frames_of,
    load,
    plain,
    point_distance,
    swirl_field,
    target,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from hsp_control import (
    FunctionCost,
    FunctionField,
    IdentityMetric,
    JointCentering,
    MassMatrixMetric,
    Rest,
    RobotState,
    TargetPosture,
    Uncontrolled,
    WeightedSum,
)
from hsp_control.null_space.fields import (
    LimitBarrier,
)

pytestmark = pytest.mark.filterwarnings("error")


# --- members, one by one -------------------------------------------------------------


def test_rest_and_uncontrolled() -> None:
    robot = load("panda")
    assert Rest(robot).controls
    assert Rest(robot).name == "rest"
    assert not Uncontrolled(robot).controls
    assert Uncontrolled(robot).name == "uncontrolled"
    assert (2.0 * Rest(robot)).controls


def test_joint_centering_is_one_half_at_a_limit() -> None:
    """Each joint at a limit costs ½ w; in the middle nothing, and the slope is 0."""
    robot = load("panda")
    field = JointCentering(robot, weights=2.0)
    low, high = robot.position_limits()
    middle = robot.state(0.0, 0.5 * (low + high), np.zeros(7))
    assert field.value(middle) == pytest.approx(0.0, abs=1e-30)
    np.testing.assert_allclose(field.gradient(middle), 0.0, atol=1e-15)
    for limit in (low, high):
        assert field.value(robot.state(0.0, limit, np.zeros(7))) == pytest.approx(7.0)


def test_joint_centering_leaves_unlimited_joints_alone() -> None:
    robot = load("kinova")
    q, _ = draw("kinova", 6)
    gradient = JointCentering(robot).gradient(robot.state(0.0, q, np.zeros(robot.nv)))
    continuous = [robot.velocity_index(j).start for j in JOINTS["kinova"]]
    np.testing.assert_array_equal(gradient[continuous], 0.0)
    assert (np.delete(gradient, continuous) != 0.0).all()


def test_limit_barrier_is_zero_in_the_middle_and_finite_beyond_a_limit() -> None:
    """And smooth through its core, 2 % of the zone: slope and bend have no jump."""
    robot = load("panda")
    field = LimitBarrier(robot, zone=0.3)
    low, high = robot.position_limits()
    middle = robot.state(0.0, 0.5 * (low + high), np.ones(7))
    assert field.value(middle) == 0.0
    np.testing.assert_array_equal(field.gradient(middle), 0.0)
    zone = 0.15 * (high - low)
    outside = robot.state(0.0, high + 0.1 * zone, np.zeros(7))
    assert np.isfinite(field.value(outside))
    assert (field.gradient(outside) > 0.0).all()

    def at(s: float) -> RobotState:
        return robot.state(0.0, high - s * zone, np.ones(7))

    for edge in (0.02, 1.0):
        inner, outer = (field.gradient(at(edge + d)) for d in (-1e-7, 1e-7))
        np.testing.assert_allclose(inner, outer, rtol=1e-4, atol=1e-5)
        inner, outer = (field.gradient_rate(at(edge + d)) for d in (-1e-7, 1e-7))
        np.testing.assert_allclose(inner, outer, rtol=1e-4, atol=1e-4)


@pytest.mark.slow
def test_target_posture_is_smooth_all_the_way_round() -> None:
    """Three turns through pi: slope and rate change by no more than their bounds.

    ∇f = w sin d has slope w, (∇f)' = w cos d v has slope w |v|: 1e-3 rad of turning
    changes them by 1e-3 of that; ½d² would jump by 2 pi w.
    """
    robot = load("planar3r")
    field = TargetPosture(robot, target("planar3r"), weights=[2.0, 3.0, 0.0])
    v, step = np.array([1.0, -1.0, 1.0]), 1e-3
    q = target("planar3r")
    slopes, rates, values = [], [], []
    for _ in range(int(6.0 * np.pi / step)):
        state = robot.state(0.0, q, v)
        slopes.append(field.gradient(state))
        rates.append(field.gradient_rate(state))
        values.append(field.value(state))
        q = robot.integrate(q, step * v)
    bound = 3.0 * step * (1 + 1e-9)
    assert np.abs(np.diff(slopes, axis=0)).max() <= bound
    assert np.abs(np.diff(rates, axis=0)).max() <= bound
    assert np.abs(np.diff(values)).max() <= 5.0 * step * (1 + 1e-9)
    assert max(values) == pytest.approx(10.0, abs=1e-5)
    # It winds: a whole turn further all is the same again.
    turn = round(2.0 * np.pi / step)
    np.testing.assert_allclose(slopes[turn], slopes[0], atol=3 * step)


def test_target_posture_agrees_with_the_square_to_fourth_order() -> None:
    robot = load("planar3r")
    field = TargetPosture(robot, robot.neutral())
    for d in (0.1, 0.05):
        q = robot.integrate(robot.neutral(), np.array([d, 0.0, 0.0]))
        value = field.value(robot.state(0.0, q, np.zeros(3)))
        assert 0.5 * d**2 - value == pytest.approx(d**4 / 24.0, rel=1e-3)


def test_target_posture_holds_limited_joints_beyond_pi() -> None:
    """A joint with limits is drawn back the way that it can go, never round."""
    pytest.importorskip("example_robot_data")
    robot = load("rolling ur5")  # joints from -2 pi to 2 pi
    shoulder = robot.velocity_index("shoulder_pan_joint").start
    moved = np.zeros(robot.nv)
    moved[shoulder] = 5.0
    state = robot.state(
        0.0, robot.integrate(robot.neutral(), moved), np.zeros(robot.nv)
    )
    gradient = TargetPosture(robot, robot.neutral()).gradient(state)
    np.testing.assert_allclose(gradient, moved, rtol=0, atol=1e-14)


def test_target_posture_leaves_a_root_alone() -> None:
    robot = load("floating ur5")
    q, v = draw("floating ur5", 7)
    field = TargetPosture(robot, robot.neutral())
    state = robot.state(0.0, q, v)
    for vector in (field.gradient(state), field.gradient_rate(state)):
        np.testing.assert_array_equal(vector[:6], 0.0)
        assert (vector[6:] != 0.0).all()


def test_point_distance_returns_its_minimum_distance() -> None:
    robot = load("planar3r")
    field = point_distance("planar3r")
    q, v = draw("planar3r", 8)
    c = OBSTACLE.center.sample(TIME).position
    positions = [plain("planar3r").position(q, f) for f in frames_of("planar3r")[:2]]
    least = min(np.linalg.norm(p - c) for p in positions)
    found = field.minimum_distance(robot.state(TIME, q, v))
    assert found == pytest.approx(least, abs=1e-14)
    assert Rest(robot).minimum_distance(robot.state(TIME, q, v)) is None


def test_given_derivatives_are_used() -> None:
    """A gradient or rate that is given is not differenced, and its cost not called."""
    robot = load("planar3r")
    state = robot.state(0.0, robot.neutral(), np.ones(3))

    def never(state: RobotState) -> Any:
        raise AssertionError("called")

    cost = FunctionCost(
        robot, never, gradient=lambda s: np.arange(3.0), gradient_rate=lambda s: s.v
    )
    g, g_dot = evaluate(cost, IdentityMetric(), state)
    np.testing.assert_array_equal(g, [0.0, -1.0, -2.0])
    np.testing.assert_array_equal(g_dot, [-1.0, -1.0, -1.0])
    field = FunctionField(robot, lambda s: np.arange(3.0), rate=lambda s: 2.0 * s.v)
    g, g_dot = evaluate(field, MassMatrixMetric(), state)
    np.testing.assert_array_equal(g, [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(g_dot, [2.0, 2.0, 2.0])


# --- sums ----------------------------------------------------------------------------


weights = st.floats(0.0, 1e3)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(weights, weights, weights)
def test_sums_are_linear(a: float, b: float, c: float) -> None:
    robot = load("panda")
    terms = [
        JointCentering(robot),
        TargetPosture(robot, target("panda")),
        swirl_field("panda", rate=True),
    ]
    state = robot.state(TIME, *draw("panda", 30))
    metric = metrics(robot)["constant"][0]
    samples = [evaluate(field, metric, state) for field in terms]
    found = evaluate(a * terms[0] + c * (b * terms[1] + terms[2]), metric, state)
    factors = (a, c * b, c)
    for k in range(2):
        parts = [factor * s[k] for factor, s in zip(factors, samples, strict=True)]
        size = 1.0 + sum(np.abs(part).max() for part in parts)
        np.testing.assert_allclose(found[k], sum(parts), rtol=0, atol=1e-14 * size)


def test_operators() -> None:
    robot = load("panda")
    a, b = JointCentering(robot), TargetPosture(robot, target("panda"))
    total = 2.0 * a + np.float64(3.0) * b + Rest(robot, name="still")
    assert isinstance(total, WeightedSum)
    assert [f.name for _, f in total.terms] == [
        "joint_centering",
        "target_posture",
        "still",
    ]
    state = robot.state(0.0, robot.home(), np.zeros(7))
    assert [w.sample(state) for w, _ in total.terms] == [(2, 0), (3, 0), (1, 0)]
    assert total.name == "joint_centering + target_posture + still"
    assert total.robot is robot
    assert total.controls
    twice = [w.sample(state) for w, _ in (2 * total).terms]
    assert twice == [(4, 0), (6, 0), (2, 0)]
    assert [f for _, f in WeightedSum([(0.0, a)]).terms] == [a]
    for wrong in (lambda: a + 1.0, lambda: "2" * a, lambda: None + a):  # type: ignore
        with pytest.raises(TypeError, match=r"unsupported operand|can't multiply"):
            wrong()
