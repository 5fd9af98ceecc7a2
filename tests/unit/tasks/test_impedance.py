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
from places import THOROUGH, covering
from states import moved
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
    ToolPose,
    place,
)
from wording import wording

import hsp_control as hsp
from hsp_control import Controller, FramePosition, Gains, JointPosture
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    CompensationError,
    ControllerError,
    GainError,
    TaskError,
)
from hsp_control.control.compensation import (
    Compensation,
    IntegralAction,
    MomentumObserver,
)
from hsp_control.null_space.metrics import IdentityMetric, MassMatrixMetric, Metric
from hsp_control.tasks import Impedance

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
    Case("panda", ToolPose("panda_tcp")),
    Case("iiwa14", ToolPose("iiwa_link_ee")),
    Case("iiwa14", Posture(None, False)),
]
every_case = pytest.mark.parametrize("case", CASES, ids=str)


def definite(rng: np.random.Generator, size: int, scale: float) -> Array:
    """Return a symmetric positive definite matrix."""
    A = np.eye(size) + 0.3 * rng.normal(size=(size, size))
    return scale * A @ A.T


def impedance(kind: str, rows: int, rng: np.random.Generator) -> Impedance:
    """Return an impedance of one kind, with stiff and soft rows."""
    each = (200.0 * rng.uniform(0.3, 3.0, rows)).tolist()
    if kind == "ratio":
        return Impedance(each, damping_ratio=0.7, largest_force="none")
    if kind in ("led", "led, damped"):
        # without stiffness along one direction, not aligned with a row
        turn = np.linalg.qr(rng.normal(size=(rows, rows)))[0]
        each[0] = 0.0
        stiffness = (turn * each) @ turn.T
        ratio = {"damping_ratio": 0.7} if kind == "led" else {"damping": 30.0}
        return Impedance(0.5 * (stiffness + stiffness.T), **ratio, largest_force="none")
    if kind == "matrices":
        stiffness, damping = definite(rng, rows, 150.0), definite(rng, rows, 20.0)
        return Impedance(stiffness, damping=damping, largest_force="none")
    return Impedance(each, damping=30.0, largest_force="none")


def mass_matrix(robot: hsp.Robot, q: Array) -> Array:
    upper = np.triu(pin.crba(robot.model, robot.model.createData(), q))
    return upper + np.triu(upper, 1).T


def errors(task: Any, motion: Motion) -> Callable[[float], Array]:
    """Return e(s) along a motion."""
    return lambda s: (
        task.evaluate(
            moved(motion.robot, TIME + s, motion.configuration(s)),
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
            state = moved(robot, TIME + s, slide.configuration(x))
            return task.evaluate(state, feedback=task.feedback()).error

        columns.append(-slide.derivative(error))
    J_e = np.array(columns).T
    return J_e @ np.linalg.solve(mass_matrix(robot, q), J_e.T), J_e


def inverse_inertias(task: Any, motion: Motion) -> Callable[[float], Array]:
    """Return Λ⁻¹(s) along a motion."""
    return lambda s: inverse_inertia(task, motion, s)[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "kind"),
    covering(CASES, ["ratio", "matrices", "led", "led, damped", "bounded"]),
    ids=str,
)
def test_the_equation_holds_for_any_force_and_metric(case: Case, kind: str) -> None:
    """Λ e'' + (½ Λ' + D) e' + s(e) = -f along the motion that follows from f."""
    rng = np.random.default_rng(3)
    metrics: list[tuple[int, Metric]]
    metrics = [(2, MassMatrixMetric()), (1, IdentityMetric())]
    if not THOROUGH:
        metrics = metrics[1:] if kind == "bounded" else metrics[:1]
    for seed, metric in metrics:
        motion = place(case, seed)
        robot, rows = motion.robot, case.family.rows
        plain = case.family.build(robot, motion, 0.5, GAINS, seed)
        rows = plain.rows
        spring = impedance(kind, rows, rng)
        task = replace(
            plain, gains=Gains(natural_frequency=10.0), impedance=spring, name="hand"
        )
        controller = Controller(robot, [task], metric=metric, limits=None)
        output = controller.compute(robot.state(TIME, motion.q, motion.v))
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
            half = sqrtm_psd(inverse)  # √(G K) = √G √(√G K √G) √G⁻¹
            root = half @ sqrtm_psd(half @ K @ half) @ np.linalg.inv(half)
            D = 2 * 0.7 * inertia @ root
            np.testing.assert_allclose(D, D.T, rtol=0, atol=1e-6 * np.abs(D).max())
        else:
            D = np.array(spring.damping) * np.eye(rows)
            if np.ndim(spring.damping) == 2:
                D = np.array(spring.damping)
        force = K @ e(0.0)
        residual = inertia @ e_ddot + (0.5 * inertia_rate + D) @ e_dot + force + f
        scale = np.abs(force).max() + np.abs(inertia @ e_ddot).max()
        assert np.abs(residual).max() < 1e-7 * scale


@pytest.mark.parametrize("case", CASES[:3], ids=str)
def test_gains_at_a_state_are_those_of_the_step(case: Case) -> None:
    """A task alone evaluates as in a controller; given gains are used."""
    motion = place(case, 4)
    robot = motion.robot
    plain = case.family.build(robot, motion, 0.3, GAINS, 4)
    bare = replace(plain, gains=Gains(natural_frequency=10.0), name="hand")
    most = [30.0] * len(bare.error_parts)
    spring = Impedance(300.0, damping=20.0, largest_force=most)
    task = replace(bare, impedance=spring)
    controller = Controller(robot, [task], limits=None)
    output = controller.compute(robot.state(TIME, motion.q, motion.v))
    state = robot.state(TIME, motion.q, motion.v)
    Kp, Kv, offset, *_ = task.feedback_at(state)
    used = controller.feedback("hand")
    np.testing.assert_allclose(used.Kp, Kp, rtol=1e-12)
    np.testing.assert_allclose(used.Kv, Kv, rtol=1e-12)
    assert not offset.any()
    own = task.evaluate(state)
    np.testing.assert_allclose(own.acceleration, output.task.acceleration, rtol=1e-11)
    again = bare.evaluate(state, feedback=used)
    np.testing.assert_allclose(again.acceleration, own.acceleration, rtol=1e-12)
    # For small errors the spring is not at its bound.
    soft = controller._linear_feedback("hand", state)[-np.inf]
    parts = np.split(own.error, np.cumsum([part.size for part in task.error_parts]))
    sizes = [np.full(len(part), np.linalg.norm(part)) for part in parts]
    kept = np.minimum(1.0, 0.1 / np.concatenate(sizes))
    np.testing.assert_allclose(soft.Kp * kept, Kp, rtol=1e-12)
    assert (kept < 1.0).any()


def test_joint_impedance_of_all_joints_has_the_mass_matrix() -> None:
    robot = hsp.Robot.load("panda")
    spring = Impedance([600, 600, 600, 600, 250, 150, 50], damping=12.0)
    task = JointPosture("home", impedance=spring)
    controller = Controller(robot, [task], limits=None)
    K = np.diag(np.array(spring.stiffness))
    for away in (0.2, -0.1, 0.4):
        q, v = robot.home() + away, np.linspace(-away, 0.5, 7)
        output = controller.compute(0.0, q, v)
        state = robot.state(0.0, q, v)
        force = K @ robot.difference(q, robot.home()) - 12.0 * v
        effort = force - 0.5 * state.mass_matrix_rate @ v + state.nonlinear_effects
        np.testing.assert_allclose(output.tau, effort, rtol=1e-9, atol=1e-9)


def test_through_a_singularity() -> None:
    """A straight arm: gains stay finite, and the term in the inertia's rate fades."""
    robot = hsp.Robot.load("planar3r")
    task = FramePosition("tip", impedance=Impedance(100.0), axes="xy", name="tip")
    controller = Controller(robot, [task], limits=None, start=bent(robot, 0.8))
    v = np.array([0.3, -1.0, 0.7])
    largest = 0.0
    for bend in [*np.geomspace(1.0, 1e-12, 200), 0.0]:
        output = controller.compute(0.0, bent(robot, bend), v)
        Kp, Kv, *_ = controller.feedback("tip")
        assert np.isfinite(output.tau).all()
        largest = max(largest, float(np.abs(Kv).max()))
    assert largest < 2e3
    assert np.linalg.matrix_rank(Kp, tol=1e-9) == 1
    np.testing.assert_allclose(  # at the singularity only the damping is left
        Kv, 2.0 * np.real(sqrtm_psd(Kp / 100.0)) * 10.0, rtol=1e-6, atol=1e-6
    )


def bent(robot: hsp.Robot, bend: float) -> Array:
    """Return a configuration of the planar arm; straight for 0."""
    return robot.integrate(robot.neutral(), np.array([0.4, bend, 0.5 * bend]))


def sqrtm_psd(A: Array) -> Array:
    """Return the square root of a symmetric positive semidefinite matrix."""
    values, vectors = np.linalg.eigh(A)
    # Zero eigenvalues are rounded, by the processor, to some 1e-15 of the greatest, of
    # which the roots would be 3e-8.
    values[values < 1e-13 * values.max()] = 0.0
    return (vectors * np.sqrt(values)) @ vectors.T


# --- changes -------------------------------------------------------------------------


def panda_hand(**fields: Any) -> Controller:
    robot = hsp.Robot.load("panda")
    home = robot.home()
    at = robot.state(0.0, home, np.zeros(7)).position("panda_tcp").copy()
    target = hsp.Hold(at + np.array([0.05, -0.03, 0.02]))
    hand = FramePosition(
        "panda_tcp", target, largest_error="none", name="hand", **fields
    )
    return Controller(robot, [hand], limits=None)


def test_stiffness_changes_without_a_jump() -> None:
    """Stiffness, kind of damping and bound: the effort is continuous and converges."""
    soft = Impedance([200, 300, 400], damping_ratio=0.7)
    hard = Impedance(2000.0, damping=150.0, largest_force=20.0)
    controller = panda_hand(impedance=soft)
    robot = controller.robot
    controller.at(1.0).ramp(0.5).impedance("hand", hard)
    v = np.linspace(-0.3, 0.3, 7)

    def effort(t: float) -> Array:
        return controller.compute(robot.state(t, robot.home(), v)).tau.copy()

    times = np.linspace(0.9, 1.6, 1401)
    tau = np.array([effort(t) for t in times])
    before, after = effort(0.9), effort(1.6)
    np.testing.assert_array_equal(tau[0], before)
    built = panda_hand(impedance=hard)  # already
    other = built.compute(built.robot.state(1.6, robot.home(), v)).tau
    np.testing.assert_allclose(after, other, rtol=1e-9, atol=1e-9)
    steps = np.abs(np.diff(tau, axis=0)).max(axis=1)
    assert steps.max() < 0.02 * np.abs(after - before).max()
    assert steps[times[1:] < 1.0].max() == 0.0
    # A smooth step begins with t³: no corner.
    begin = np.abs(effort(1.0 + 1e-3) - before).max()
    assert begin < 1e-6 * np.abs(after - before).max()


def later(first: Impedance) -> Any:
    """Return the changes at 1 s of a hand that starts with an impedance."""
    return panda_hand(impedance=first).at(1.0)


REFUSED: dict[str, tuple[Callable[[], Any], type[Exception], str]] = {
    "two dampings": (lambda: Impedance(1.0, damping=1.0, damping_ratio=1.0), GainError,
     "... damping or damping_ratio"),
    "gains and impedance": (
     lambda: FramePosition(gains=Gains(1.0, 2.0), impedance=Impedance(1.0)), GainError,
     "... gains [1/s², 1/s] ... impedance [N/m, N·s/m]"),
    "rows": (lambda: panda_hand(impedance=Impedance([1.0, 2.0])), GainError,
     "tasks.hand.impedance: stiffness ... (2,) ... a number"),
    "another task": (lambda: hsp.CenterOfMass(impedance=Impedance(1.0)),  # type: ignore[call-arg]
     TaskError, "... impedance"),
    "gains of a spring": (
     lambda: panda_hand(impedance=Impedance(1.0)).at(1.0).gains("hand", GAINS),
     ControllerError,
     "task: 'hand' ... impedance instead of gains"),
    "spring of gains": (lambda: panda_hand().at(1.0).impedance("hand", Impedance(1.0)),
     ControllerError,
     "task: 'hand' has no impedance"),
    "rows of a change": (
     lambda: later(Impedance(1.0)).impedance("hand", Impedance([1.0, 2.0])), GainError,
     "impedance: stiffness ... (2,) ... a number"),
    "integral action": (
     lambda: Compensation(integral_action=IntegralAction(1.0)).check(
         hsp.Robot.load("panda"), panda_hand(impedance=Impedance(1.0)).tasks),
     CompensationError,
     "... task 'hand' ... integral action"),
    "a cancelling observer": (lambda: Compensation(
        momentum_observer=MomentumObserver()).check(hsp.Robot.load("panda"),
        panda_hand(impedance=Impedance(1.0)).tasks),
     CompensationError,
     "... momentum_observer: ... task 'hand'"),
    "clip without cancellation": (lambda: MomentumObserver(clip=3.0, cancel=False),
     CompensationError,
     "... clip ... cancel is false"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_refusals(name: str) -> None:
    make, error, message = REFUSED[name]
    with pytest.raises(error, match=wording(message)):
        make()


def test_a_floating_base_is_refused() -> None:
    pytest.importorskip("example_robot_data")
    robot = hsp.Robot.load("ur5", root="free_flyer")
    hand = FramePosition("tool0", impedance=Impedance(100.0))
    message = "tasks.tool0.impedance: ur5 has a free-flyer root: its inertia at a task"
    with pytest.raises(GainError, match=message):
        Controller(robot, [hand], base="driven")
