"""Steps within limits: the optimum of a QP; where infeasible, the relaxed rows."""

from functools import cache
from typing import Any

import limit_oracle
import numpy as np
import pytest
import quadprog
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_robots import panda

import hsp_control as hsp
from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import Scaled
from hsp_control.control.actuation import Actuation, Delivered, Status
from hsp_control.control.actuation.limited_step import Barriers
from hsp_control.engine.inspection import calls

seeds = st.integers(0, 2**32 - 1)


def arm(
    strength: float = 0.5, static: float | str = "none", **options: Any
) -> hsp.Controller:
    """Return a weak arm whose posture has a lower priority than its hand."""
    path = hsp.Circle(0.2, 4.0, [0.45, 0.0, 0.45], normal=[0.0, 0.0, 1.0])
    gains = hsp.Gains(natural_frequency=10.0)
    hand = hsp.FramePosition("panda_tcp", path, gains=gains, name="hand")
    elbow = hsp.JointPosture(
        panda().home(), gains=gains, joints=["panda_joint1"], name="j1", priority=2
    )
    field = 20.0 * hsp.JointCentering()
    limits = hsp.Limits(effort=Scaled(strength), static_effort=static)
    return hsp.Controller(panda(), [hand, elbow], field, limits=limits, **options)


def pressing() -> hsp.Controller:
    """Return a weak arm commanded to press beyond its motors' limits."""
    contact = hsp.contacts.SlidingContact(
        "panda_tcp", friction=0.4, force=hsp.contacts.CommandedForce([4.0, 2.0, 40.0])
    )
    gains = hsp.Gains(natural_frequency=10.0)
    path = hsp.Circle(0.2, 4.0, [0.45, 0.0])
    hand = hsp.FramePosition("panda_tcp", path, axes="xy", gains=gains, name="hand")
    limits = hsp.Limits(effort=Scaled(0.4), velocity="none", position="none")
    return hsp.Controller(panda(), [hand], contacts=[contact], limits=limits)


@cache
def controller(name: str) -> tuple[hsp.Controller, Array]:
    """Return a controller, and the configuration around which states are drawn."""
    if name == "mass matrix":
        metric = hsp.metrics.MassMatrixMetric()
        return arm(metric=metric), panda().home()
    if name == "arm":
        return arm(), panda().home()
    if name == "pressing":
        return pressing(), panda().home()
    loaded = hsp.load_experiment(name)
    return loaded.controller, loaded.q0


def drawn(name: str, seed: int, spread: float) -> hsp.Controller:
    """Return a controller after a step at a random state."""
    made, q0 = controller(name)
    rng = np.random.default_rng(seed)
    q = made.robot.integrate(q0, spread * rng.standard_normal(made.robot.nv))
    v = 3.0 * spread * rng.standard_normal(made.robot.nv)
    made.compute(made.robot.state(0.3, q, v))
    return made


def actuation_of(made: hsp.Controller) -> Actuation:
    """Return the object that delivered the controller's last step."""
    ((limits, _),) = made._in_force.limits.sets
    return made._in_force.mixture.actuation(made._active, limits)


def repeated(made: hsp.Controller, barriers: Barriers | None = None) -> Delivered:
    """Return the nearest step at the controller's state, with rows of barriers."""
    stack, state, actuation = made._active, made.state, actuation_of(made)
    a, wanted = stack.law.acceleration, actuation._wanted
    wanted.acceleration[:], wanted.effort[:] = a, state.inverse_dynamics(a)
    if stack.support.size:
        stack.support.update(stack.law)
        stack.support.minimum_norm_forces(wanted.effort)
    return actuation._nearest(a, False, barriers or {})


@pytest.mark.parametrize(
    ("name", "spread"),
    [
        ("arm", 0.5),
        ("mass matrix", 0.5),
        ("pressing", 0.5),
        ("forces/talos_wall", 0.01),
        ("whole_body/solo12_trunk", 0.05),
        ("whole_body/talos_circle", 0.01),
    ],
)
@given(seeds)
@settings(max_examples=25)
def test_it_is_the_optimum(name: str, spread: float, seed: int) -> None:
    """Within all rows, at no higher cost than DAQP's solution of the same QP."""
    made = drawn(name, seed, spread)
    _, a, forces, status, _ = repeated(made)
    if status != Status.LIMITED:
        return
    stack, state = made._active, made.state
    weight, bounds = stack.support.weight, actuation_of(made)._limits.bounds
    wanted = actuation_of(made)._wanted.acceleration  # see `limited_target`
    made_by = actuation_of(made)._qp
    assert made_by is not None
    qp = limit_oracle.limited_step(
        state.mass_matrix,
        wanted,
        state.inverse_dynamics(wanted),
        (bounds.tau_lower, bounds.tau_upper),
        (bounds.a_lower, bounds.a_upper),
        stack.law,
        stack.support,
        stack.support.base,
        weight,
        made.robot.size,
        made_by.held,
        made_by.slack[0],
    )
    x = np.concatenate([a - wanted, forces / weight])
    scale = np.linalg.norm(qp.rows.A, axis=1) * (1.0 + np.abs(x).max())
    value = qp.rows.A @ x
    beyond = np.maximum(qp.rows.lower - value, value - qp.rows.upper) / scale
    assert beyond.max() < 1e-7
    other = limit_oracle.solve(*qp)
    if other is None:  # the oracle fails on some feasible QPs
        return
    cost, least = (0.5 * each @ qp.H @ each + qp.f @ each for each in (x, other))
    assert cost <= least + 1e-6 * (1.0 + abs(least))


# --- where limits contradict each other ----------------------------------------------


@given(seeds)
@settings(max_examples=25)
def test_least_violation_is_the_least(seed: int) -> None:
    """Weak motors, joints near their limits and fast: the same QP by quadprog."""
    rng = np.random.default_rng(seed)
    _, upper = panda().position_limits()
    q, v = panda().home(), np.zeros(7)
    joint = int(rng.integers(7))
    q[joint], v[joint] = upper[joint] - 0.02, rng.uniform(1.0, 2.0)
    task = hsp.FramePosition("panda_tcp", gains=hsp.Gains(natural_frequency=10.0))
    limits = hsp.Limits(effort=2.0, velocity=None, static_effort=None)
    made = hsp.Controller(panda(), [task], limits=limits)
    out = made.compute(0.0, q, v)
    if out.status != Status.RELAXED:
        return
    assert (np.abs(out.tau) <= 2.0).all()
    M, bounds = made.state.mass_matrix, actuation_of(made)._limits.bounds
    a = made._active.law.acceleration
    tau = made.state.inverse_dynamics(a)
    H = np.diag(np.concatenate([np.full(7, 1e-9), np.ones(7)]))
    effort, motion = np.hstack([M, 0.0 * M]), np.hstack([np.eye(7), np.eye(7)])
    C = np.vstack([effort, -effort, motion, -motion])
    b = np.concatenate([-2.0 - tau, tau - 2.0, bounds.a_lower - a, a - bounds.a_upper])
    x = quadprog.solve_qp(H, np.zeros(14), C.T, b)[0]
    assert out.relaxation == pytest.approx(np.abs(x[7:]).max(), rel=1e-4)


def row(direction: Array, least: float) -> tuple[Array, Array]:
    return direction[None, :], np.array([least])


def test_distances_are_relaxed_less_than_motion_and_motion_less_than_holding() -> None:
    """The violations of a quadratic cost are in inverse proportion to the costs."""
    made = arm()
    made.compute(0.0, panda().home(), np.zeros(7))
    bounds, first = actuation_of(made)._limits.bounds, np.eye(7)[5]
    bounds.tau_lower[:], bounds.tau_upper[:] = -np.inf, np.inf
    for kind, cost in (("barriers", 30.0), ("holding", 0.1)):
        bounds.a_upper[5], bounds.a_lower[5] = 1.0, -np.inf
        _, a, _, status, relaxation = repeated(made, {kind: row(first, 5.0)})
        assert status == Status.RELAXED
        assert (a[5] - 1.0) / (5.0 - a[5]) == pytest.approx(cost, rel=1e-3)
        assert relaxation == pytest.approx(max(a[5] - 1.0, 5.0 - a[5]), rel=1e-4)
    both = {"barriers": row(first, 5.0), "holding": row(-first, 5.0)}
    bounds.a_upper[5] = np.inf
    a = repeated(made, both)[1]
    assert (a[5] + 5.0) / (5.0 - a[5]) == pytest.approx(300.0, rel=1e-2)


def test_a_violation_does_not_depend_on_the_distance_of_the_target() -> None:
    """All other unknowns cost 1e-6, which fades out: it would shift a by 0.01."""
    made, far = arm(), -1e4
    made.compute(0.0, panda().home(), np.zeros(7))
    bounds, first = actuation_of(made)._limits.bounds, np.eye(7)[5]
    bounds.tau_lower[:], bounds.tau_upper[:] = -np.inf, np.inf
    bounds.a_upper[5], bounds.a_lower[5] = far, -np.inf
    _, a, _, status, _ = repeated(made, {"holding": row(first, far + 1.1)})
    assert status == Status.RELAXED
    # The costs 1 and 0.1 share the 1.1 rad/s²; rows are widened by 1e-7 of a more.
    assert a[5] - far == pytest.approx(0.1, abs=2e-3)


def test_contacts_are_relaxed_less_than_distances() -> None:
    made = drawn("whole_body/solo12_trunk", 1, 0.0)
    stack = made._active
    rise = stack.law.problem.task.jacobian[2]
    a = stack.law.acceleration
    requested = row(rise, float(rise @ a) + 4.0)
    _, found, _, status, _ = repeated(made, {"barriers": requested})
    assert status == Status.RELAXED
    moved = float(rise @ (found - a))
    assert moved / (4.0 - moved) == pytest.approx(30.0 / 1e3, rel=0.05)
    # The next step, without the contradiction, equals one without that history.
    _, found, _, status, _ = repeated(made)
    assert status == Status.LIMITED
    np.testing.assert_allclose(found, a, atol=1e-7)


@pytest.mark.parametrize(
    ("strength", "static"), [(0.7, "none"), (0.01, "none"), (0.2, 0.9)]
)
def test_one_native_call_is_the_same_as_its_parts(
    strength: float, static: float | str
) -> None:
    """An idle modifier selects the other path: check, then deliver."""
    made, rng, seen = arm(strength, static), np.random.default_rng(0), set()
    made.restart(origin=0.0)
    for k in range(60):
        if k == 30:  # another stack is prepared for a later step
            made.prepare(made.state, without=["j1"])
        q = panda().home() + 0.3 * rng.standard_normal(7)
        v = 0.3 * rng.standard_normal(7)
        parts = made.compute(0.3, q, v, modifier=lambda _, __, a: (a, None))
        assert made._settled_step is not None
        once = made.compute(0.3, q, v)
        seen.add(once.status)
        assert once.status is parts.status
        assert once.relaxation == parts.relaxation
        assert once.damped == parts.damped
        np.testing.assert_array_equal(once.tau, parts.tau)
        np.testing.assert_array_equal(once.acceleration, parts.acceleration)
    assert {Status.LIMITED, Status.RELAXED if strength < 0.5 else Status.EXACT} <= seen


def test_a_relaxed_step_does_not_depend_on_steps_before() -> None:
    """Bit for bit as if nothing had been active in their QPs."""
    made, rng, relaxed = arm(0.1, 0.5), np.random.default_rng(0), 0
    made.compute(0.3, panda().home(), np.zeros(7))
    marks = [
        call.values["work.held"]
        for call in calls(made.step_plan)
        if isinstance(call, engine.Call) and "work.held" in call.values
    ]
    assert len(marks) == 3
    for _ in range(1000):
        q = panda().home() + 0.3 * rng.standard_normal(7)
        v = 2.0 * rng.standard_normal(7)
        out = made.compute(0.3, q, v)
        expected, relaxation = out.tau.copy(), out.relaxation
        relaxed += out.status >= Status.RELAXED
        for held in marks:
            held[:] = 0
        again = made.compute(0.3, q, v)
        np.testing.assert_array_equal(again.tau, expected)
        assert again.relaxation == relaxation
    assert relaxed > 900


def test_a_step_is_not_the_result_of_an_earlier_qp() -> None:
    """Without limits nothing is checked; a QP is solved only where a foot would
    slip."""
    loaded = hsp.load_experiment("whole_body/solo12_trunk", "limits=none")
    made, rng, seen = loaded.controller, np.random.default_rng(0), []
    made.compute(0.0, loaded.q0, loaded.v0)
    for spread in 10 * [1.0, 0.0]:
        v = loaded.v0 + spread * rng.standard_normal(made.robot.nv)
        out = made.compute(0.0, loaded.q0, v)
        parts = made.compute(0.0, loaded.q0, v, modifier=lambda _, __, a: (a, None))
        seen.append(out.status)
        assert out.status is parts.status
        np.testing.assert_array_equal(out.tau, parts.tau)
    assert {Status.EXACT, Status.LIMITED} <= set(seen)
