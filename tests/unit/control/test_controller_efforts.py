"""The controller's output, without memory, near singularities too."""

import numpy as np
import pinocchio as pin
import pytest
from controller_cases import (
    METRICS,
    assert_same,
    circle,
    contents,
    hold_orientation,
    metrics,
    states,
    track,
)
from loaded_robots import panda
from numpy.testing import assert_allclose, assert_array_equal

import hsp_control as hsp
from hsp_control import Controller, FramePosition, Limits, TargetPosture
from hsp_control.common.errors import ControllerError
from hsp_control.control.actuation import Status

# --- the output ----------------------------------------------------------------------


@metrics
def test_effort_is_m_a_plus_n(kind: str) -> None:
    """Equation (7), with M and N by plain Pinocchio."""
    field = TargetPosture(panda().home())
    controller = Controller(
        panda(), [track()], field, metric=METRICS[kind](7), limits=None
    )
    model, data = panda().model, panda().model.createData()
    for t, q, v in states(5):
        out = controller.compute(panda().state(t, q, v))
        M = pin.crba(model, data, q).copy()
        N = pin.rnea(model, data, q, v, np.zeros(7)).copy()
        expected = M @ out.acceleration + N
        scale = np.abs(expected).max()
        assert_allclose(out.tau, expected, rtol=0, atol=1e-13 * scale)
        # The plant answers with that acceleration; cond(M) is below 1e4.
        a = panda().forward_dynamics(q, v, out.tau)
        size = np.abs(out.acceleration).max()
        assert_allclose(a, out.acceleration, rtol=0, atol=1e-11 * size)


@metrics
def test_diagnosis(kind: str) -> None:
    metric = METRICS[kind](7)
    field = TargetPosture(panda().home(), weights=2.0)
    controller = Controller(
        panda(), [track(), hold_orientation()], field, metric=metric, limits=None
    )
    for t, q, v in states(3, seed=1):
        state = panda().state(t, q, v)
        out = contents(controller.compute(state))
        diagnosis = controller.diagnose()
        W = metric.evaluate(state, hsp.metrics.MetricSample.allocate(7)).W
        J, e_N = out["task.jacobian"], out["null_space_error"]
        whitened = J @ np.linalg.inv(np.linalg.cholesky(W)).T
        expected = np.linalg.svd(whitened)[1]
        assert_allclose(
            diagnosis.singular_values, expected, rtol=0, atol=1e-13 * expected[0]
        )
        assert_allclose(
            diagnosis.manipulability,
            np.linalg.det(J @ np.linalg.solve(W, J.T)),
            rtol=1e-9,
        )
        assert_allclose(diagnosis.null_space_norm, np.sqrt(e_N @ W @ e_N), rtol=1e-13)
        assert diagnosis.field_value == controller.field.value(state)
        # Reading the output changes nothing.
        again = controller.diagnose()
        assert_array_equal(again.singular_values, diagnosis.singular_values)
        assert_same(contents(controller.compute(state)), out)


def test_a_state_may_be_given_in_any_form() -> None:
    """Bit for bit; values that float32 represents exactly, also given as float32."""
    controller = Controller(panda(), [track()], TargetPosture("home"), limits=None)
    t, q, v = states(1)[0]
    q, v = q.astype(np.float32).astype(float), v.astype(np.float32).astype(float)
    expected = contents(controller.compute(panda().state(t, q, v)))
    forms = [
        (q, v),
        (q.tolist(), tuple(v)),
        (q.astype(np.float32), v.astype(np.float32)),
        (np.repeat(q, 2)[::2], v[::-1][::-1]),
    ]
    for form in forms:
        assert_same(contents(controller.compute(t, *form)), expected)
    own = controller.state.update(t, q, v)
    assert_same(contents(controller.compute(own)), expected)
    assert controller.state is own
    with pytest.raises(ControllerError, match="needs t, q and v, or a RobotState"):
        controller.compute(t)  # type: ignore[call-overload]


def test_a_step_in_one_call_is_the_step_in_many() -> None:
    """Bit for bit: with (t, q, v) a step is one native call, with a state several."""
    level = FramePosition("panda_link4", circle(), priority=2)
    found = set[tuple[Status, bool]]()
    for tasks, limits in (
        ([track(), hold_orientation()], Limits()),
        ([track(), level], Limits(effort=30.0, velocity=1.0)),
        ([track(), hold_orientation(), level], None),
        ([track()], None),
    ):
        controller = Controller(panda(), tasks, TargetPosture(), limits=limits)
        rest = panda().home(), np.zeros(7)
        controller.compute(0.0, *rest)
        slow = [(t, *rest) for t in (0.0, 0.1)]
        upright = (0.0, np.zeros(7), np.zeros(7))
        for t, q, v in [*slow, upright, *states(20, seed=4)]:
            one = controller.compute(t, q, v)
            many = controller.compute(panda().state(t, q, v))
            assert_same(contents(one), contents(many))
            assert (one.status, one.relaxation) == (many.status, many.relaxation)
            found.add((one.status, bool(one.damped)))
    kinds = {Status.EXACT, Status.LIMITED, Status.RELAXED, Status.BEYOND}
    assert found >= {(Status.EXACT, False), (Status.EXACT, True)}
    assert {status for status, _ in found} == kinds


# --- near singularities --------------------------------------------------------------
