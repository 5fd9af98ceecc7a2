"""Time-varying weights, and sums of fields."""

import re
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loaded_robots import load
from oracles import slope
from wording import wording

from hsp_control import (
    Controller,
    FramePosition,
    Gains,
    Hold,
    JointCentering,
    NullSpaceField,
    Obstacle,
    Rest,
    Robot,
    RobotState,
    TargetPosture,
    simulate,
)
from hsp_control.common.errors import FieldError
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import (
    ConstantWeight,
    FieldSample,
    FieldSum,
    FunctionField,
    LimitBarrier,
    Manipulability,
    ObstacleClearance,
    PointDistance,
    Ramp,
    StateWeight,
    Weight,
)
from hsp_control.null_space.fields.weight import sample_weight
from hsp_control.null_space.metrics import (
    ConstantMetric,
    IdentityMetric,
    MassMatrixMetric,
    Metric,
    MetricSample,
)
from hsp_control.robot import Rk4
from hsp_control.trajectories import Lissajous

METRICS: dict[str, Metric] = {
    "identity": IdentityMetric(),
    "constant": ConstantMetric(np.arange(1.0, 8.0)),
    "mass matrix": MassMatrixMetric(),
}


def evaluate(field: NullSpaceField, metric: Metric, state: RobotState) -> FieldSample:
    """Return copies of g and g' at a state."""
    nv = state.robot.nv
    sample = metric.evaluate(state, MetricSample.allocate(nv))
    out = FieldSample(np.full(nv, np.nan), np.full(nv, np.nan))
    assert field.evaluate(state, sample, metric.form, out) is out
    return out


def random_state(robot: Robot, seed: int, t: float = 0.8) -> RobotState:
    """Return a state within the limits, moving."""
    rng = np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    return robot.state(t, q, 0.7 * rng.normal(size=robot.nv))


# -- weights ---------------------------------------------------------------------------

at_time = st.floats(-1.0, 3.0)
weights = st.floats(0.0, 5.0)


@given(t=at_time, a=weights, b=weights, start=st.floats(-0.5, 0.5),
       duration=st.floats(0.1, 2.0))  # fmt: skip
def test_ramp_and_its_rate(
    t: float, a: float, b: float, start: float, duration: float
) -> None:
    """The quintic between the ends, constant outside; the rate is its derivative.

    The only error of fourth-order differences of s⁵ is h⁴ f⁽⁵⁾/30.
    """
    state = at(t)
    w, w_dot = Ramp(initial=a, final=b, start=start, duration=duration).sample(state)
    s = np.clip((t - start) / duration, 0.0, 1.0)
    expected = a + (b - a) * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
    assert w == pytest.approx(expected, rel=1e-14, abs=1e-14)
    assert min(a, b) - 1e-14 <= w <= max(a, b) + 1e-14
    rate = (b - a) * 30.0 * s**2 * (1.0 - s) ** 2 / duration
    assert w_dot == pytest.approx(rate, rel=1e-13, abs=1e-13)
    if s in {0.0, 1.0}:
        assert (w, w_dot) == (a if s == 0.0 else pytest.approx(b, rel=1e-15), 0.0)
    step = 1e-3 * duration
    if 2.0 * step < (t - start) < duration - 2.0 * step:
        ramp = Ramp(initial=a, final=b, start=start, duration=duration)
        by_differences = slope(lambda h: ramp.sample(at(t + h))[0], 0.5 * step)
        assert w_dot == pytest.approx(float(by_differences), abs=1e-11 / step)


def at(t: float) -> RobotState:
    """Return the Panda's state at home at a time, always the same object."""
    return memory().update(t, load("panda").home(), np.zeros(7))


@cache
def memory() -> RobotState:
    """Return a state without values."""
    return load("panda").state(0.0, load("panda").home(), np.zeros(7))


def test_a_weight_of_the_state_and_its_rate() -> None:
    """Exact by the product rule, for functions with derivatives."""
    robot = load("panda")
    weight = StateWeight(
        lambda s: 1.5 + np.sin(2.0 * s.t + s.position("panda_hand")[0])
    )
    for seed in range(5):
        state = random_state(robot, seed)
        w, w_dot = weight.sample(state)
        hand = state.frame("panda_hand")
        angle = 2.0 * state.t + hand.position[0]
        assert w == pytest.approx(1.5 + np.sin(angle), rel=1e-15)
        assert w_dot == pytest.approx(
            np.cos(angle) * (2.0 + hand.velocity[0]), rel=0, abs=1e-10
        )


# -- sums ------------------------------------------------------------------------------

BALL = Obstacle(
    "ball", Sphere(0.1), Lissajous([0.1, 0.1, 0.1], [1, 2, 3], center=[0.5, 0.4, 0.5])
)


def swirl(robot: Robot) -> FunctionField:
    """Return a field of time that is no gradient."""
    i = np.arange(robot.nv)
    return FunctionField(
        lambda s: np.sin(s.t + i) * s.position("panda_hand")[0],
        rate_function=lambda s: (
            np.cos(s.t + i) * s.position("panda_hand")[0]
            + np.sin(s.t + i) * s.frame("panda_hand").velocity[0]
        ),
    )


def moving_sum(robot: Robot) -> FieldSum:
    """Return a sum of a sum with time-varying weights."""
    rising = Ramp(initial=0.2, final=2.0, start=0.1, duration=1.5)
    falling = Ramp(initial=2.0, final=0.0, start=0.0, duration=2.0)
    of_state = StateWeight(lambda s: 1.2 + np.cos(s.t + s.position("panda_hand")[2]))
    home = TargetPosture(robot.home())
    inner = rising * JointCentering() + 3.0 * home
    return FieldSum(
        [
            of_state * inner,
            falling * swirl(robot),
            0.7 * PointDistance(["panda_hand", "panda_link4"], BALL),
            0.0 * Manipulability("panda_hand"),
        ]
    )


def shares(
    field: FieldSum, metric: Metric, state: RobotState
) -> tuple[FieldSample, tuple[FieldSample, ...]]:
    """Return g and g' of a sum, and the weighted ones of each term, by their calls."""
    nv = state.robot.nv
    sample = metric.evaluate(state, MetricSample.allocate(nv))
    out, terms = FieldSample.allocate(nv), field.allocate_terms(nv)
    state.run(field.calls_of_terms(state, sample, metric.form, out, terms))
    return out, terms


def test_each_terms_share_is_kept_and_they_add_up() -> None:
    robot = load("panda")
    field = moving_sum(robot)
    state = random_state(robot, 7)
    (g, g_dot), samples = shares(field, METRICS["mass matrix"], state)
    whole = evaluate(field, METRICS["mass matrix"], state)
    np.testing.assert_array_equal(g, whole.g)
    np.testing.assert_array_equal(g_dot, whole.g_dot)
    assert len(field.terms) == len(samples) == 5
    np.testing.assert_allclose(sum(s.g for s in samples), g, rtol=0, atol=1e-13)
    np.testing.assert_allclose(sum(s.g_dot for s in samples), g_dot, rtol=0, atol=1e-12)
    value = 0.0
    for term, sample in zip(field.terms, samples, strict=True):
        w, w_dot = sample_weight(term.weight, state)
        own = evaluate(term, METRICS["mass matrix"], state)
        np.testing.assert_allclose(sample.g, w * own.g, rtol=1e-14, atol=1e-14)
        np.testing.assert_allclose(
            sample.g_dot, w * own.g_dot + w_dot * own.g, rtol=1e-13, atol=1e-13
        )
        value += w * term.value(state)
    assert field.value(state) == pytest.approx(value, rel=1e-14)
    assert not samples[-1].g.any()  # of weight 0


def test_the_log_has_the_share_of_every_term() -> None:
    """Columns ``field.<name>.g`` add up to ``field.g`` in every row of a run."""
    robot = load("panda")
    ramp = Ramp(initial=0.0, final=1.0, start=0.02, duration=0.1)
    field = FieldSum(
        [
            JointCentering(weight=ramp),
            0.5 * JointCentering(weights=np.arange(7.0)),
            2.0 * ObstacleClearance([BALL], influence=0.4),
            LimitBarrier(),
        ]
    )
    hold = FramePosition("panda_tcp", Hold(), gains=Gains(100, 20))
    rollout = simulate(
        Controller(robot, [hold], field, limits=None),
        robot.home(),
        duration=0.1,
        integrator=Rk4(0.005),
    )
    names = [
        "joint_centering_0", "joint_centering_1", "obstacle_clearance", "limit_barrier"
    ]  # fmt: skip
    found = {
        name.removeprefix("field.").removesuffix(".g")
        for name in rollout.columns
        if re.fullmatch(r"field\..+\.g", name)
    }
    assert found == set(names)
    shares = [rollout[f"field.{name}.g"] for name in names]
    np.testing.assert_allclose(sum(shares), rollout["field.g"], rtol=0, atol=1e-14)
    np.testing.assert_array_equal(shares[0][:3], 0.0)  # its ramp begins at 0.02 s
    assert np.abs(shares[0][-1]).max() > 1e-3
    assert np.abs(shares[2]).max() > 1e-2
    parts = [rollout[f"field.{name}.value"] for name in names]
    w = [ramp.sample(at(t))[0] for t in rollout.t]
    total = w * parts[0] + 0.5 * parts[1] + 2.0 * parts[2] + parts[3]
    np.testing.assert_allclose(total, rollout["field.value"], rtol=1e-13)
    assert (rollout["distance.obstacle_clearance"] < 0.4).all()
    described = rollout.meta["columns"]
    assert all(f"field.{name}.g" in described for name in names)


# -- refusals --------------------------------------------------------------------

MISTAKES: list[tuple[Callable[[], Any], str]] = [
    (lambda: ConstantWeight(-1.0), "ConstantWeight: value: -1.0 ... negative"),
    (lambda: ConstantWeight(np.nan), "ConstantWeight: value: nan ... finite"),
    (lambda: Ramp(initial=-1.0, final=1.0, duration=1.0), "... initial: -1.0 ... neg"),
    (lambda: Ramp(final=1.0, duration=0.0), "Ramp: duration: 0.0 ... greater than 0"),
    (lambda: Ramp(final=1.0), "Ramp: missing ... 'duration'"),
    (lambda: Ramp(0.0, 1.0), "Ramp: ... by position"),  # type: ignore
    (lambda: StateWeight(lambda s: -0.5).sample(at(0.0)), "... weight is -0.5"),
    (lambda: StateWeight(2.0), "StateWeight: function:"),  # type: ignore
    (lambda: -1.0 * JointCentering(), "JointCentering: weight: -1.0 ... negative"),
    (lambda: JointCentering(weight="much"),  # type: ignore
     "JointCentering: weight: 'much' ... a number"),
    (lambda: -1.0 * JointCentering(weight=Ramp(final=1.0, duration=1.0)),
     "Ramp: final: -1.0 ... at least 0"),
    (lambda: -1.0 * JointCentering(weight=StateWeight(lambda s: 1.0)),
     "ConstantWeight: value: -1.0 ... at least 0"),
    (lambda: LimitBarrier(zone=0.0), "LimitBarrier: zone: 0.0 ... greater than 0"),
    (lambda: LimitBarrier(zone=1.1), "LimitBarrier: zone: 1.1 ... too large"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("make", "message"), MISTAKES, ids=[message[:40] for _, message in MISTAKES]
)
def test_every_mistake_is_named(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(FieldError) as caught:
        make()
    assert re.search(wording(message), str(caught.value))


def test_invalid_weights_and_fields() -> None:
    field = Rest()
    with pytest.raises(TypeError):
        "2" * field  # type: ignore[operator]
    with pytest.raises(TypeError):
        field + 1.0  # type: ignore[operator]
    with pytest.raises(TypeError):
        Weight()  # type: ignore[abstract]
