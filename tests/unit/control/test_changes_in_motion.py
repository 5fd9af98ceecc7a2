"""Changes while the robot moves: no effort jumps, and the law's proofs hold throughout.

`test_changes.py` has changes that overlap, in any number.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from loaded_robots import panda
from places import covering
from runs import check_null_space
from scipy.integrate import quad, solve_ivp

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.null_space.fields import FieldSample
from hsp_control.robot.differences import rate_along_flow
from hsp_control.robot.integrators import Dop853
from hsp_control.trajectories import HoldOrientation, Lissajous, Spin
from hsp_control.trajectories.schedule import smooth_step

K_N = 4.0
START, RAMP = 0.2, 0.3
W0 = 10.0
GAINS = hsp.Gains(natural_frequency=W0)
COUPLED = hsp.Gains(
    [[60.0, 8.0, 0.0], [-5.0, 40.0, 3.0], [0.0, 2.0, 30.0]],
    [[12.0, 1.0, 0.0], [0.0, 15.0, 2.0], [1.0, 0.0, 9.0]],
)


def posture() -> hsp.TargetPosture:
    q = panda().home().copy()
    q[2] += 0.5
    return hsp.TargetPosture(q, weight=2.0)


def hand() -> hsp.FramePosition:
    start = panda().state(0.0, panda().home(), np.zeros(7)).position("panda_tcp")
    center = start + np.array([0.0, 0.0, 0.05])
    path = hsp.Circle(0.05, 2.0, center, normal=[1.0, 0.0, 0.0])
    return hsp.FramePosition(
        "panda_tcp", path, gains=GAINS, largest_error="none", name="hand"
    )


TURNED = hsp.FrameOrientation(
    "panda_tcp",
    HoldOrientation([3.0, 0.2, 0.1]),
    gains=hsp.Gains(natural_frequency=5.0),
    largest_error="none",
    name="turned",
    priority=2,
)


def controller(
    field: hsp.NullSpaceField | None = None,
    *more: hsp.Task,
    metric: hsp.metrics.Metric | None = None,
    **options: Any,
) -> hsp.Controller:
    options = {"null_space_gain": K_N, "metric": metric, **options}
    return hsp.Controller(
        panda(),
        [hand(), *more],
        field or hsp.JointCentering(),
        **({"limits": None} | options),
    )


def run(law: hsp.Controller, duration: float = 0.8, **options: Any) -> hsp.Rollout:
    settings = {"log_period": 0.02, "integrator": Dop853(rtol=1e-10, atol=1e-10)}
    v0 = 0.2 * np.ones(7)
    return hsp.simulate(
        law, panda().home(), v0, duration=duration, **settings | options
    )


def share(t: float, start: float = START, ramp: float = RAMP) -> float:
    return smooth_step(t, start, ramp)[0]


# --- Proposition 2: V decays through every change ------------------------------------


def g_at(
    field: hsp.NullSpaceField, metric: hsp.metrics.Metric, state: hsp.RobotState
) -> FieldSample:
    sample, at = FieldSample.allocate(7), hsp.metrics.MetricSample.allocate(7)
    return field.evaluate(state, metric.evaluate(state, at), metric.form, sample)


@given(t=st.floats(-0.5, 2.0), seed=st.integers(0, 2**32 - 1))
def test_the_rate_in_between_is_exact(t: float, seed: int) -> None:
    """A field fades to another one, and before that ends to a third."""
    # At the begin and end of a change it is C² only.
    assume(all(abs(t - edge) > 0.01 for edge in (0.0, 0.6, 1.0, 1.4)))
    rng = np.random.default_rng(seed)
    law, metric = controller(), hsp.metrics.IdentityMetric()
    law.at(0.0).ramp(1.0).field(posture(), 0.5 * hsp.Manipulability("panda_tcp"))
    law.at(0.6).ramp(0.8).field(hsp.TargetPosture("home"))
    state = panda().state(t, panda().random_configuration(rng), rng.standard_normal(7))
    exact = g_at(law.field, metric, state).g_dot.copy()

    def g(at: hsp.RobotState) -> Array:
        return g_at(law.field, metric, at).g.copy()

    # Differences along the flow are good to about 1e-9 of g'.
    np.testing.assert_allclose(
        exact, rate_along_flow(g, state), atol=1e-8 * (1.0 + np.abs(exact).max())
    )


def swaying() -> hsp.TargetPosture:
    """A posture that moves in time."""
    sway = Lissajous(np.full(7, 0.2), np.linspace(1.0, 4.0, 7), None, np.zeros(7))
    return replace(posture(), displacement=sway)


CHANGES: dict[str, Callable[[hsp.Controller], Any]] = {
    "several fields": lambda law: (
        law.at(START).ramp(RAMP).field(posture(), hsp.Manipulability("panda_tcp"))
    ),
    "rest": lambda law: law.at(START).ramp(RAMP).field(),
    "weight": lambda law: law.at(START).ramp(RAMP).weight("joint_centering", 3.0),
    "exchange": lambda law: (
        law.at(START).ramp(RAMP).exchange("joint_centering", swaying())
    ),
    "all": lambda law: (
        law.at(START).ramp(RAMP).field(posture(), hsp.Rest()).gains("hand", COUPLED)
    ),
    "two at a time": lambda law: (
        law.at(START).ramp(RAMP).field(posture()),
        law.at(START + 0.1).ramp(0.1).field(hsp.JointCentering()),
        law.at(START + 0.15).ramp(0.3).weight("joint_centering", 2.0),
    ),
}


@pytest.mark.parametrize(
    ("part", "metric"),
    covering(CHANGES, [hsp.metrics.MassMatrixMetric(), hsp.metrics.IdentityMetric()]),
)
def test_proposition_2_holds_all_the_way(part: str, metric: hsp.metrics.Metric) -> None:
    """‖e_N‖_W decays like exp(-K_N t) before, through and after the change."""
    law = controller(metric=metric)
    CHANGES[part](law)
    log = run(law)
    check_null_space(log, K_N, least=0.1, rtol=1e-6)


@pytest.mark.parametrize(
    "metric", [hsp.metrics.IdentityMetric(), hsp.metrics.MassMatrixMetric()]
)
def test_proposition_2_holds_while_its_gain_changes(metric: hsp.metrics.Metric) -> None:
    """‖e_N‖_W' = -K_N(t) ‖e_N‖_W."""
    law = controller(metric=metric)
    law.at(START).ramp(RAMP).null_space_gain(15.0).field(posture())
    log = run(law)
    passed = [
        quad(lambda t: K_N + (15.0 - K_N) * share(t), 0.0, end, points=[START])[0]
        for end in log.t
    ]
    expected = log["null_space_norm"][0] * np.exp(-np.array(passed))
    np.testing.assert_allclose(log["null_space_norm"], expected, rtol=1e-6)
    np.testing.assert_array_equal(law.null_space_gain, 15.0 * np.eye(7))


# --- the error equation --------------------------------------------------------------


def solution(
    log: hsp.Rollout, gains: Callable[[float], tuple[Array, Array]], task: str = "hand"
) -> Array:
    """Return e(t) of e'' + Kv(t) e' + Kp(t) e = 0 from the log's first error."""
    m = log[f"task.{task}.error"].shape[1]

    def rate(t: float, x: Array) -> Array:
        Kp, Kv = gains(t)
        return np.r_[x[m:], -Kv @ x[m:] - Kp @ x[:m]]

    first = np.r_[log[f"task.{task}.error"][0], log[f"task.{task}.error_rate"][0]]
    found = solve_ivp(
        rate, (0.0, log.t[-1]), first, "DOP853", log.t, rtol=1e-11, atol=1e-13
    )
    return found.y[:m].T


def far() -> hsp.FramePosition:
    """Return a task whose hand is 10 cm off its path."""
    return replace(
        hand(),
        trajectory=hsp.Circle(0.05, 2.0, [0.45, 0.1, 0.5], normal=[1.0, 0.0, 0.0]),
    )


def test_the_error_equation_holds_while_gains_change() -> None:
    """Two overlapping changes of coupled gains, against an integrated solution."""
    law = hsp.Controller(
        panda(), [far()], hsp.JointCentering(), null_space_gain=K_N, limits=None
    )
    law.at(START).ramp(RAMP).gains("hand", COUPLED)
    law.at(START + 0.1).ramp(0.15).gains("hand", hsp.Gains([9.0, 16.0, 25.0], 9.0))

    def gains(t: float) -> tuple[Array, Array]:
        Kp, Kv = GAINS.matrices(3)
        for new, start, ramp in (
            (COUPLED, START, RAMP),
            (hsp.Gains([9.0, 16.0, 25.0], 9.0), START + 0.1, 0.15),
        ):
            s = share(t, start, ramp)
            Kp, Kv = (
                (1.0 - s) * old + s * to
                for old, to in zip((Kp, Kv), new.matrices(3), strict=True)
            )
        return Kp, Kv

    log = run(law)
    error = log["task.hand.error"]
    assert np.abs(error[0]).max() > 0.05
    np.testing.assert_allclose(error, solution(log, gains), rtol=0, atol=1e-8)
    # The motion differs from that with either of the gains.
    for one in (GAINS, COUPLED):
        other = solution(log, lambda t, one=one: one.matrices(3))
        assert np.abs(error - other).max() > 1e-3


def test_the_error_equation_holds_while_references_change() -> None:
    """Position and orientation; the error is that of a frame in between."""
    turned = replace(TURNED, priority=1)
    law = hsp.Controller(
        panda(), [far(), turned], hsp.JointCentering(), null_space_gain=K_N, limits=None
    )
    law.at(START).ramp(RAMP).reference("hand", hsp.Hold([0.5, 0.0, 0.4]))
    law.at(START + 0.1).ramp(0.4).reference("turned", Spin([0, 0, 1], 0.5))
    law.at(START + 0.2).ramp(RAMP).reference("hand", hand().trajectory)
    log = run(law, 1.0)
    for task in (far(), turned):
        gains = task.gains.matrices(3)
        found = log[f"task.{task.name}.error"]
        assert np.abs(found[0]).max() > 0.05
        expected = solution(log, lambda t, gains=gains: gains, task.name)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(
        log["task.hand.reference"][-1], hand().trajectory.sample(1.0).position
    )


@pytest.mark.parametrize("priority", [1, 2])
def test_the_error_equation_of_other_tasks_holds_while_one_comes_and_goes(
    priority: int,
) -> None:
    law = hsp.Controller(
        panda(), [far()], hsp.JointCentering(), null_space_gain=K_N, limits=None
    )
    law.at(0.1).ramp(0.2).add(replace(TURNED, priority=priority))
    law.at(0.4).ramp(0.3).remove("turned").weight("joint_centering", 0.1)
    log = run(law)
    expected = solution(log, lambda t: GAINS.matrices(3))
    np.testing.assert_allclose(log["task.hand.error"], expected, rtol=0, atol=1e-8)
    # While the weight is one, the error obeys its equation.
    t, e = log.t, log["task.turned.error"]
    alone = (t >= 0.3) & (t <= 0.4)
    first = np.flatnonzero(alone)[0]
    s, w = (t[alone] - t[first])[:, None], 5.0
    rate = log["task.turned.error_rate"][first]
    expected = np.exp(-w * s) * (e[first] + (rate + w * e[first]) * s)
    np.testing.assert_allclose(e[alone], expected, rtol=0, atol=1e-8)
