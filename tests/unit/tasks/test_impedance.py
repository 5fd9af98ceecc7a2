"""A task with an impedance moves as its inertia on springs and dampers, exactly.

The inertia and its rate are taken from plain Pinocchio and differences along a motion,
never from the kernels that compute the gains.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.linalg import sqrtm
from task_cases import (
    GAINS,
    SECOND,
    TIME,
    Case,
    Motion,
    Orientation,
    Pose,
    Position,
    Posture,
    place,
)

import hsp_control as hsp
from hsp_control import Controller, Gains
from hsp_control.null_space.metrics import (
    IdentityMetric,
    MassMatrixMetric,
)
from hsp_control.tasks import Impedance

pytestmark = pytest.mark.filterwarnings("error")
Array = NDArray[np.float64]

CASES = [
    Case("planar3r", Position("tip", "xy")),
    Case("planar3r", Posture(None, True)),
    Case("panda", Position("panda_tcp", "xyz")),
    Case("panda", Position("panda_tcp", "zx")),
    Case("panda", Orientation("panda_tcp")),
    Case("panda", Pose("panda_tcp")),
    Case("panda", Posture(None, True)),
    Case("panda", Posture(("panda_joint4", "panda_joint2"), False)),
    Case("iiwa14", Position("iiwa_link_ee", "yz")),
    Case("iiwa14", Orientation("iiwa_link_ee")),
    Case("iiwa14", Pose("iiwa_link_ee")),
    Case("iiwa14", Posture(None, False)),
]
every_case = pytest.mark.parametrize("case", CASES, ids=str)


def definite(rng: np.random.Generator, size: int, scale: float) -> Array:
    """Return a symmetric positive definite matrix."""
    A = np.eye(size) + 0.3 * rng.normal(size=(size, size))
    return scale * A @ A.T


def impedance(kind: str, rows: int, rng: np.random.Generator) -> Impedance:
    """Return an impedance of one kind; stiff rows beside soft ones."""
    each = (200.0 * rng.uniform(0.3, 3.0, rows)).tolist()
    if kind == "ratio":
        return Impedance(each, damping_ratio=0.7)
    if kind == "matrices":
        return Impedance(definite(rng, rows, 150.0), damping=definite(rng, rows, 20.0))
    return Impedance(each, damping=30.0, largest_error=0.2)


def mass_matrix(robot: hsp.Robot, q: Array) -> Array:
    upper = np.triu(pin.crba(robot.model, robot.model.createData(), q))
    return upper + np.triu(upper, 1).T


def errors(task: Any, motion: Motion) -> Callable[[float], Array]:
    """Return e(s) along a motion."""
    robot, still = motion.robot, np.zeros(motion.robot.nv)
    return lambda s: (
        task.evaluate(
            robot.state(TIME + s, motion.configuration(s), still),
            feedback=task.feedback(),
        ).error
    )


def inverse_inertia(task: Any, motion: Motion, s: float) -> tuple[Array, Array]:
    """Return Λ⁻¹ and J_e at a point of a motion, J_e = -∂e/∂q by differences."""
    robot, q = motion.robot, motion.configuration(s)
    columns = []
    for direction in np.eye(robot.nv):
        slide = Motion(robot, q, direction, np.zeros(robot.nv))

        def error(x: float, slide: Motion = slide) -> Array:
            state = robot.state(TIME + s, slide.configuration(x), np.zeros(robot.nv))
            return task.evaluate(state, feedback=task.feedback()).error

        columns.append(-slide.derivative(error))
    J_e = np.array(columns).T
    return J_e @ np.linalg.solve(mass_matrix(robot, q), J_e.T), J_e


def inverse_inertias(task: Any, motion: Motion) -> Callable[[float], Array]:
    """Return Λ⁻¹(s) along a motion."""
    return lambda s: inverse_inertia(task, motion, s)[0]


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ratio", "matrices", "bounded"])
@every_case
def test_the_equation_holds_whatever_the_force_and_the_metric(
    case: Case, kind: str
) -> None:
    """Λ e'' + (½ Λ' + D) e' + K sat(e) = -f along the motion that follows from f."""
    rng = np.random.default_rng(3)
    for seed, metric in ((1, IdentityMetric()), (2, MassMatrixMetric())):
        motion = place(case, seed)
        robot, rows = motion.robot, case.family.rows
        plain = case.family.build(robot, motion, 0.5, GAINS, seed)
        rows = plain.rows
        spring = impedance(kind, rows, rng)
        task = replace(
            plain, gains=Gains(natural_frequency=10.0), impedance=spring, name="hand"
        )
        controller = Controller(robot, [task], metric=metric, limits=None)
        output = controller.compute(TIME, motion.q, motion.v)
        assert not output.damped
        still = Motion(robot, motion.q, motion.v, np.zeros(robot.nv))
        inverse, J_e = inverse_inertia(task, still, 0.0)
        f = 20.0 * rng.normal(size=rows)
        push = np.linalg.solve(mass_matrix(robot, motion.q), J_e.T @ f)
        moving = Motion(robot, motion.q, motion.v, output.acceleration + push)
        e = errors(task, moving)
        e_dot, e_ddot = moving.derivative(e), moving.derivative(e, SECOND)
        # Λ' depends on q and v alone.
        rate = moving.derivative(inverse_inertias(task, moving))
        inertia = np.linalg.inv(inverse)
        inertia_rate = -inertia @ rate @ inertia
        K = np.array(spring.stiffness)
        K = np.diag(K) if K.ndim == 1 else K
        if spring.damping is None:
            D = 2 * 0.7 * inertia @ np.real(sqrtm(inverse @ K))
            np.testing.assert_allclose(D, D.T, rtol=0, atol=1e-6 * np.abs(D).max())
        else:
            D = np.array(spring.damping) * np.eye(rows)
            if np.ndim(spring.damping) == 2:
                D = np.array(spring.damping)
        bound = np.inf if spring.largest_error is None else 0.2
        force = K @ np.clip(e(0.0), -bound, bound)
        residual = inertia @ e_ddot + (0.5 * inertia_rate + D) @ e_dot + force + f
        scale = np.abs(force).max() + np.abs(inertia @ e_ddot).max()
        assert np.abs(residual).max() < 1e-7 * scale
