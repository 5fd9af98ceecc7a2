"""A field that changes while the robot moves: nothing jumps, Proposition 2 holds."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsp_control import (
    Circle,
    Controller,
    FramePosition,
    Gains,
    Hold,
    JointCentering,
    Manipulability,
    NullSpaceField,
    Rest,
    Robot,
    TargetPosture,
    simulate,
)
from hsp_control.common.exceptions import ControllerError, FieldError
from hsp_control.null_space.differences import rate_along_flow
from hsp_control.null_space.fields import FieldSample, Uncontrolled
from hsp_control.null_space.fields.crossfade import crossfade
from hsp_control.null_space.metrics import (
    IdentityMetric,
    MassMatrixMetric,
    Metric,
    MetricSample,
)
from hsp_control.robot import RobotState
from hsp_control.simulation.recorder import Recorder

Array = NDArray[np.float64]
K_N = 4.0
START, RAMP = 0.2, 0.3


@cache
def panda() -> Robot:
    return Robot.load("panda")


def posture() -> NullSpaceField:
    q = panda().home().copy()
    q[2] += 0.5
    return TargetPosture(q, weights=2.0)


def controller(field: NullSpaceField, metric: Metric | None = None) -> Controller:
    start = panda().state(0.0, panda().home(), np.zeros(7)).position("panda_tcp")
    path = Circle(0.05, 2.0, start + np.array([0.0, 0.0, 0.05]), normal=[1.0, 0.0, 0.0])
    task = FramePosition("panda_tcp", path, gains=Gains(natural_frequency=10.0))
    return Controller(panda(), [task], field, null_space_gain=K_N, metric=metric)


def g_at(field: NullSpaceField, metric: Metric, state: RobotState) -> FieldSample:
    sample = FieldSample.allocate(7)
    form = metric.form
    return field.evaluate(
        state, metric.evaluate(state, MetricSample.allocate(7)), form, sample
    )


@given(t=st.floats(-0.5, 1.5), seed=st.integers(0, 2**32 - 1))
def test_the_rate_of_what_is_in_between_is_exact(t: float, seed: int) -> None:
    assume(min(abs(t), abs(t - 1.0)) > 0.01)  # there the ramp is C², not more
    rng = np.random.default_rng(seed)
    field = crossfade(JointCentering(), 3.0 * posture(), start=0.0, duration=1.0)
    metric = IdentityMetric()
    state = panda().state(t, panda().random_configuration(rng), rng.standard_normal(7))
    exact = g_at(field, metric, state).g_dot.copy()

    def g(at: RobotState) -> Array:
        return g_at(field, metric, at).g.copy()

    # Differences along the flow are good to about 1e-9 of g'.
    np.testing.assert_allclose(
        exact, rate_along_flow(g, state), atol=1e-8 * (1.0 + np.abs(exact).max())
    )


@pytest.mark.parametrize("metric", [IdentityMetric(), MassMatrixMetric()])
def test_proposition_2_holds_all_the_way(metric: Metric) -> None:
    """‖e_N‖_W decays like exp(-K_N t) before, through and after the change."""
    law = controller(JointCentering(), metric)
    after = Manipulability("panda_tcp")
    law.change_field(after, start=START, ramp=RAMP)
    v0 = 0.2 * np.ones(7)
    run = simulate(law, panda().home(), v0, duration=0.8, log_period=0.02)
    expected = run["null_space_norm"][0] * np.exp(-K_N * run.t)
    assert run["null_space_norm"][0] > 0.1
    # The integrator's tolerance is 1e-9 a step; the exponential is the law's proof.
    np.testing.assert_allclose(run["null_space_norm"], expected, rtol=1e-6)
    assert law.field is after


def test_the_effort_does_not_jump_and_ends_as_the_new_field_s() -> None:
    law = controller(JointCentering())
    new = posture()
    state = panda().state(0.0, panda().home(), np.full(7, 0.1))
    law.change_field(new, start=START, ramp=RAMP)
    times = np.arange(0.0, 0.8, 1e-4)

    def efforts(some: Controller) -> Array:
        rows = [some.compute(state.update(t, state.q, state.v)).tau for t in times]
        return np.array([row.copy() for row in rows])

    # One state, moving time: what is left is the circle's own motion and the ramp's.
    changing = efforts(law)
    old, final = (efforts(controller(f)) for f in (JointCentering(), posture()))
    rtol = {"rtol": 1e-12, "atol": 1e-12}
    np.testing.assert_allclose(changing[times < START], old[times < START], **rtol)
    over = times >= START + RAMP
    np.testing.assert_allclose(changing[over], final[over], **rtol)
    most = np.abs(final - old).max()
    # The quintic's slope is at most 15/8 over the ramp; g' adds its second derivative.
    steepest = most * (15 / 8 / RAMP + 10 / np.sqrt(3) / RAMP**2 / K_N) * 1e-4
    circles = np.abs(np.diff(old, axis=0)).max() + np.abs(np.diff(final, axis=0)).max()
    assert np.abs(np.diff(changing, axis=0)).max() < 2.0 * steepest + circles


def test_a_change_of_mind_begins_where_the_field_is() -> None:
    law = controller(JointCentering())
    law.change_field(posture(), start=0.1, ramp=0.4)
    state = panda().state(0.0, panda().home(), np.zeros(7))
    taus = []
    for t in np.arange(0.0, 1.2, 1e-3):
        if abs(t - 0.3) < 1e-9:  # half-way: back to rest
            final = Rest()
            law.change_field(final, start=0.3, ramp=0.4)
        taus.append(law.compute(state.update(t, state.q, state.v)).tau.copy())
    assert law.field is final
    # 1e-3 s of a change over 0.4 s: a jump would be the whole of it.
    steps = np.abs(np.diff(taus, axis=0)).max(axis=1)
    assert steps.max() < 0.05 * np.abs(np.ptp(taus, axis=0)).max()


def test_what_cannot_change_is_refused() -> None:
    law = controller(JointCentering())
    with pytest.raises(FieldError, match="uncontrolled"):
        law.change_field(Uncontrolled(), start=0.0, ramp=1.0)
    with pytest.raises(FieldError, match="positive, finite duration"):
        law.change_field(posture(), start=0.0, ramp=0.0)
    with pytest.raises(ControllerError):
        law.change_field(Rest(), start=0.0, ramp=1.0)
    assert isinstance(law.field, JointCentering)


def test_the_log_has_the_terms_of_both_and_of_tasks_that_come() -> None:
    law = controller(JointCentering())
    other = FramePosition(
        "panda_link4",
        Hold([0.3]),
        gains=Gains(natural_frequency=5.0),
        name="elbow",
        axes="x",
    )

    def change(recorder: Recorder) -> None:
        done = len(recorder.rows(0)["t"])
        if done == 3:
            law.change_field(posture(), start=0.03, ramp=0.03)
        if done == 5:
            law.add_task(other, start=0.05, ramp=0.02)

    options: dict[str, Any] = {"control_period": 0.001, "log_period": 0.01}
    run = simulate(law, panda().home(), duration=0.15, on_row=change, **options)
    assert run.meta["tasks"]["elbow"]["rows"] == 1
    for name, first in (
        ("field.target_posture.g", 3),
        ("task.elbow.error", 5),
    ):
        seen = np.isfinite(run[name]).all(axis=1)
        assert not seen[:first].any()
        assert seen[first + 1 :].all()
    # What is drawn has a place before it came: where it first was.
    place = run["task.elbow.actual"]
    assert (place[:5] == place[5]).all()
    # The old field's share is gone from the log when it is gone from the sum.
    assert np.isnan(run["field.joint_centering.g"][-1]).all()
    assert np.isfinite(run["field.g"]).all()
    assert run["singular_values"].shape[1] == 4
