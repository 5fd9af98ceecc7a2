"""J, J', e' and the error equation of every task, at large errors too."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_robots import load
from places import covering
from states import moved
from task_cases import (
    CASES,
    GAINS,
    SECOND,
    TIME,
    Case,
    Direction,
    Motion,
    every_task,
    place,
    wobble,
)

from hsp_control import Gains, Pointing, Task
from hsp_control.common.arrays import Array
from hsp_control.tasks import AngularMomentum

# --- the members ---------------------------------------------------------------------


@pytest.mark.slow
@every_task
def test_the_rows_move_as_the_robot_does(case: Case) -> None:
    """J v and J' are the rates of the rows' coordinates and of J itself.

    Differences of eighth order leave 1e-11 here, most of it truncation.
    """
    for seed in (1, 2):
        motion = place(case, seed)
        robot = motion.robot
        task = case.family.build(robot, motion, 0.5, GAINS, seed)
        state = robot.state(TIME, motion.q, motion.v)
        sample = task.evaluate(state)
        assert sample.jacobian.shape == (task.rows, robot.nv)
        rate = motion.derivative(case.family.coordinates(task, motion))
        np.testing.assert_allclose(sample.jacobian @ motion.v, rate, rtol=0, atol=1e-10)

        def jacobian(s: float, motion: Motion = motion, task: Task = task) -> Array:
            q = motion.configuration(s)
            return task.evaluate(moved(motion.robot, TIME + s, q, motion.v)).jacobian

        np.testing.assert_allclose(
            sample.jacobian_dot, motion.derivative(jacobian), rtol=0, atol=1e-10
        )


def gains_of(kind: str, rows: int, seed: int) -> tuple[Gains, Array, Array]:
    """Return gains and their matrices, which are not symmetric."""
    rng = np.random.default_rng(seed)
    if kind == "scalar":
        return GAINS, 25.0 * np.eye(rows), 10.0 * np.eye(rows)
    if kind == "per row":
        kp, kv = rng.uniform(15.0, 35.0, rows), rng.uniform(8.0, 12.0, rows)
        return Gains(kp, kv), np.diag(kp), np.diag(kv)
    kp = 25.0 * np.eye(rows) + rng.uniform(-2.5, 2.5, (rows, rows))
    kv = 12.0 * np.eye(rows) + rng.uniform(-1.0, 1.0, (rows, rows))
    return Gains(kp, kv), kp, kv


def shortened(task: Task, e: Array, largest: float) -> Array:
    """Return s(e); a direction's coordinates have another bound."""
    if isinstance(task, Pointing):
        return e
    ends = np.cumsum([part.size for part in task.error_parts])[:-1]
    parts = [
        part * min(1.0, largest / float(np.linalg.norm(part)))
        for part in np.split(e, ends)
    ]
    return np.concatenate(parts)


@pytest.mark.parametrize(
    ("case", "kind"),
    covering(
        CASES,
        [(0.0, "matrix", "none"), (0.03, "per row", "none"), (1 / 3, "matrix", "none"),
         (1.0, "scalar", "none"), (1.0, "matrix", "none"), (1.0, "matrix", 0.4)],
    ),
    ids=str,
)  # fmt: skip
def test_the_law_of_the_error(case: Case, kind: tuple[float, str, Any]) -> None:
    """With J a + J'v = a_x the reported error obeys e'' + Kv e' + Kp s(e) = 0.

    At errors up to 3 rad or m (2.5 rad for pointing), in motion, with any motion in the
    null space. The residual, 5e-10 of e, is the rounding of second differences
    (1e-16/h² with h = 0.5 to 10 ms) and 1e-11 of Kp e.
    """
    part, gains, largest = kind
    seed = 11
    motion = place(case, seed)
    robot, rng = motion.robot, np.random.default_rng(seed)
    rows = case.family.build(robot, motion, 0.1, GAINS, seed).rows
    chosen, Kp, Kv = gains_of(gains, rows, seed)
    error = part * case.family.largest
    task = case.family.build(robot, motion, error, chosen, seed, largest)
    sample = task.evaluate(robot.state(TIME, motion.q, motion.v))
    assert np.linalg.norm(sample.error) == pytest.approx(
        case.family.size(error), rel=1e-9, abs=1e-14
    )

    J, wanted = sample.jacobian, sample.acceleration
    inverse = np.linalg.pinv(J)
    a = rng.normal(size=robot.nv)
    a += inverse @ (wanted - sample.jacobian_dot @ motion.v - J @ a)
    motion = Motion(robot, motion.q, motion.v, a, case.family.stride)

    def reported(s: float) -> Array:
        # The error is a function of (t, q), at any velocity.
        state = moved(robot, TIME + s, motion.configuration(s), motion.v)
        return task.evaluate(state).error

    e = sample.error
    e_dot = motion.derivative(reported)
    e_ddot = motion.derivative(reported, SECOND)
    size = 1.0 + np.abs(e_dot).max() + np.abs(e).max()
    np.testing.assert_allclose(sample.error_rate, e_dot, rtol=0, atol=3e-10 * size)
    fed = e if largest == "none" else shortened(task, e, largest)
    expected = -Kv @ e_dot - Kp @ fed
    np.testing.assert_allclose(e_ddot, expected, rtol=0, atol=5e-9 * size)


@pytest.mark.slow
@every_task
def test_reference_rate_is_the_motion_of_who_stays_on_the_reference(case: Case) -> None:
    """At e = 0, a robot with J v = reference_rate has e' = 0."""
    motion = place(case, 5)
    robot = motion.robot
    task = case.family.build(robot, motion, 0.0, GAINS, 5)
    state = robot.state(TIME, motion.q, motion.v)
    rate = task.reference_rate(state)
    J = task.evaluate(state).jacobian
    assert rate.shape == (task.rows,)
    state = robot.state(TIME, motion.q, np.linalg.pinv(J) @ rate)
    sample = task.evaluate(state)
    np.testing.assert_allclose(sample.error, 0.0, rtol=0, atol=2e-15 * 10)
    np.testing.assert_allclose(sample.error_rate, 0.0, rtol=0, atol=1e-13)
    # Only rates that depend on q may change with q, and none depends on v.
    np.testing.assert_array_equal(task.reference_rate(state), rate)
    if not isinstance(case.family, Direction):
        elsewhere = robot.state(TIME, robot.neutral(), motion.v)
        np.testing.assert_array_equal(task.reference_rate(elsewhere), rate)
    moving = getattr(case.family, "moves", True) and (
        getattr(case.family, "motion_of_reference", "") not in {"still", "spinning"}
    )
    assert (np.linalg.norm(rate) > 0.01) == moving


@pytest.mark.slow
@every_task
def test_measure(case: Case) -> None:
    """Reference and actual as for a plot, continuous beyond half a turn."""
    for seed, part in ((6, 0.2), (7, 1.0)):
        motion = place(case, seed)
        error = part * case.family.largest
        task = case.family.build(motion.robot, motion, error, GAINS, seed)
        state = motion.robot.state(TIME, motion.q, motion.v)
        e = task.evaluate(state).error
        reference, actual = task.measure(state)
        case.family.check_measure(task, motion, reference, actual, e)


# --- angular momentum ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "root"), [("panda", None), ("iiwa14", None), ("ur5", "free_flyer")]
)
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_angular_momentum_obeys_its_first_order_equation(
    name: str, root: Any, seed: int
) -> None:
    """ℓ = A v / m is Pinocchio's; J' is dJ/dt; ℓ' = J a + J'v gives e' = -K e."""
    robot = load(name, root)
    rng = np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    v, a = rng.standard_normal((2, robot.nv))
    motion = Motion(robot, q, v, a)
    target = wobble(np.array([0.1, -0.2, 0.3]))
    task = AngularMomentum(target, 7.0)
    sample = task.evaluate(robot.state(TIME, q, v))
    data, mass = robot.model.createData(), pin.computeTotalMass(robot.model)

    def rows(s: float) -> Array:
        matrix = pin.ccrba(robot.model, data, motion.configuration(s), v)
        return matrix[3:] / mass

    def momentum(s: float) -> Array:
        return rows(s) @ (v + s * a)

    np.testing.assert_allclose(sample.jacobian, rows(0.0), rtol=0, atol=1e-13)
    scale = max(1.0, float(np.abs(sample.jacobian_dot).max()))
    np.testing.assert_allclose(
        sample.jacobian_dot, motion.derivative(rows), rtol=0, atol=1e-9 * scale
    )
    rate = motion.derivative(momentum)
    np.testing.assert_allclose(
        sample.jacobian @ a + sample.jacobian_dot @ v, rate, rtol=0, atol=1e-9 * scale
    )
    # Where the law holds, ℓ' = a_x, the error's rate is the sample's.
    desired = target.sample(TIME)
    np.testing.assert_allclose(sample.error, desired.position - momentum(0.0))
    np.testing.assert_allclose(
        desired.velocity - sample.acceleration, -7.0 * sample.error, atol=1e-12
    )
    np.testing.assert_allclose(sample.error_rate, -7.0 * sample.error)
