"""The paper's three propositions along whole motions, on three robots and metrics.

Errors are computed from the logged configurations by plain Pinocchio, not taken from
the controller's columns.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from loaded_robots import load
from places import covering
from scipy.optimize import minimize

from hsp_control import (
    Controller,
    FramePose,
    FramePosition,
    Gains,
    Hold,
    JointCentering,
    NullSpaceField,
    Obstacle,
    Pointing,
    Robot,
    RobotState,
    Rollout,
    TargetPosture,
    Task,
    simulate,
)
from hsp_control.common.arrays import Array
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import EqualJointAngles, FunctionField, PointDistance
from hsp_control.null_space.metrics import (
    ConstantMetric,
    IdentityMetric,
    MassMatrixMetric,
    Metric,
)
from hsp_control.robot.integrators import Dop853
from hsp_control.trajectories import (
    Circle,
    ComposedPose,
    HoldOrientation,
    HoldPose,
    Lissajous,
    Spin,
)

FRAMES = {"planar3r": "tip", "panda": "panda_tcp", "iiwa14": "iiwa_link_ee"}
NEAR = {
    "planar3r": ("link2", "link3"),
    "panda": ("panda_link4", "panda_hand"),
    "iiwa14": ("iiwa_link_4", "iiwa_link_6"),
}
PRECISE = Dop853(rtol=1e-11, atol=1e-11)

# Differences of eighth order, at -4 h ... 4 h.
FIRST = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840


def differences(column: Array, step: float) -> Array:
    """Return the derivative of a column at its rows 4 to -5."""
    windows = np.lib.stride_tricks.sliding_window_view(column, len(FIRST), axis=0)
    return windows @ FIRST / step


class Plain:
    """Kinematics, dynamics and rows by plain Pinocchio."""

    def __init__(self, robot: Robot) -> None:
        self.model = robot.model
        self.data = robot.model.createData()

    def placement(self, q: Array, frame: str) -> pin.SE3:
        pin.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.model.getFrameId(frame)].copy()

    def jacobians(self, q: Array, v: Array, frame: str) -> tuple[Array, Array]:
        """Return J and J' of a frame, in world axes, linear before angular."""
        index = self.model.getFrameId(frame)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pin.computeJointJacobiansTimeVariation(self.model, self.data, q, v)
        pin.updateFramePlacement(self.model, self.data, index)
        return (
            pin.getFrameJacobian(self.model, self.data, index, axes).copy(),
            pin.getFrameJacobianTimeVariation(
                self.model, self.data, index, axes
            ).copy(),
        )

    def mass_matrix(self, q: Array) -> Array:
        upper = np.triu(pin.crba(self.model, self.data, q))
        return upper + np.triu(upper, 1).T


@cache
def plain(name: str) -> Plain:
    return Plain(load(name))


def constant(nv: int) -> Array:
    """Return a constant metric that couples all joints."""
    A = np.eye(nv) + 0.25 * np.random.default_rng(nv).normal(size=(nv, nv))
    return A.T @ A


METRICS: dict[str, tuple[Callable[[int], Metric], Callable[[str, Array], Array]]] = {
    "identity": (lambda nv: IdentityMetric(), lambda n, q: np.eye(load(n).nv)),
    "constant": (lambda nv: ConstantMetric(constant(nv)),
                 lambda n, q: constant(load(n).nv)),
    "mass matrix": (lambda nv: MassMatrixMetric(),
                    lambda n, q: plain(n).mass_matrix(q)),
}  # fmt: skip


def home(name: str) -> Array:
    """Return a start away from singularities, without symmetries."""
    robot = load(name)
    if name == "planar3r":
        return robot.integrate(robot.neutral(), np.array([-0.4, 0.9, 0.8]))
    q = robot.home()
    return robot.integrate(q, 0.15 * np.cos(1.0 + np.arange(robot.nv)))


# --- the tasks -----------------------------------------------------------------------


@dataclass(frozen=True)
class TaskCase:
    """Tasks on a robot, started off their reference.

    Attributes:
        build: The tasks, for the frame's placement at the start.
        errors: The tasks' errors at (t, q) by plain Pinocchio, for the same placement.
        frequency: Natural frequency of the critically damped gains [rad/s].
    """

    robot: str
    build: Callable[[Robot, pin.SE3], list[Task]]
    errors: Callable[[pin.SE3], dict[str, Callable[[float, pin.SE3], Array]]]
    frequency: float
    metric: str = "identity"


def gains(frequency: float) -> Gains:
    return Gains(natural_frequency=frequency)


def circle_about(start: Array, off: Array) -> Lissajous:
    """Return a motion in space that starts ``off`` the given point, with a speed."""
    return Lissajous([0.05, 0.04, 0.03], [2.0, 3.0, 4.0], center=start + off)


def swing(start: Array, off: Array, t: float) -> Array:
    rates = np.array([2.0, 3.0, 4.0])
    return start + off + np.array([0.05, 0.04, 0.03]) * np.sin(rates * t)


OFF = np.array([0.03, -0.05, 0.04])
TURNED = np.array([0.9, -1.0, 0.7])  # 1.5 rad off
SPUN = np.array([0.3, 0.2, -0.4])  # rad/s
LEANT = pin.exp3(np.array([0.9, 0.4, 0.2]))


def turned(start: pin.SE3, t: float) -> Array:
    return pin.exp3(t * SPUN) @ start.rotation @ pin.exp3(TURNED)


def spin(start: pin.SE3) -> Spin:
    return Spin(SPUN, float(np.linalg.norm(SPUN)), rotation=turned(start, 0.0))


def log3_error(desired: Array, actual: Array) -> Array:
    return -pin.log3(desired.T @ actual)


def stereographic(desired: Array, direction: Array) -> Array:
    n = desired.T @ direction
    return -n[:2] / (1.0 + n[2])


def about(center: Array, t: float) -> Array:
    """Return the planar arm's circle."""
    return center + 0.9 * np.array([np.cos(2.0 * t + 0.4), np.sin(2.0 * t + 0.4)])


def off_by(start: pin.SE3) -> Callable[[float, pin.SE3], Array]:
    """Return the error of a position that oscillates about its start."""
    return lambda t, here: swing(start.translation, OFF, t) - here.translation


TASKS: dict[str, TaskCase] = {
    "planar position": TaskCase(
        "planar3r",
        lambda robot, start: [
            FramePosition("tip", Circle(0.9, 2.0, [1.0, 1.0], phase=0.4),
                          gains=gains(8.0), axes="xy")
        ],
        lambda start: {"tip": lambda t, at: about(np.ones(2), t) - at.translation[:2]},
        8.0,
        "constant",
    ),
    "iiwa14 position": TaskCase(
        "iiwa14",
        lambda robot, start: [
            FramePosition("iiwa_link_ee", circle_about(start.translation, OFF),
                          gains=gains(6.0))
        ],
        lambda start: {"iiwa_link_ee": off_by(start)},
        6.0,
        "mass matrix",
    ),
    "iiwa14 pose": TaskCase(
        "iiwa14",
        lambda robot, start: [
            FramePose("iiwa_link_ee",
                      ComposedPose(circle_about(start.translation, OFF), spin(start)),
                      gains=gains(5.0))
        ],
        lambda start: {
            "iiwa_link_ee": lambda t, here: np.concatenate(
                [off_by(start)(t, here), log3_error(turned(start, t), here.rotation)])
        },
        5.0,
    ),
    "panda position and pointing": TaskCase(
        "panda",
        lambda robot, start: [
            FramePosition("panda_tcp", circle_about(start.translation, OFF),
                          gains=gains(5.0)),
            Pointing("panda_tcp", axis=[0.0, 0.0, 1.0],
                     trajectory=HoldOrientation(LEANT @ start.rotation),
                     gains=gains(5.0)),
        ],
        lambda start: {
            "panda_tcp": off_by(start),
            "panda_tcp_pointing": lambda t, here: stereographic(
        LEANT @ start.rotation, here.rotation[:, 2]), }, 5.0
    ),
}  # fmt: skip
every_task = pytest.mark.parametrize("which", TASKS)
LOG_PERIOD = 0.005  # [s]
DURATION = 0.5  # of self-motion [s]


@cache
def tracked(which: str) -> tuple[Controller, Rollout]:
    """Return a motion of 1 s from off the reference, at another velocity."""
    case = TASKS[which]
    robot = load(case.robot)
    q0 = home(case.robot)
    start = plain(case.robot).placement(q0, FRAMES[case.robot])
    field = TargetPosture(robot.integrate(q0, np.full(robot.nv, 0.2)))
    metric = METRICS[case.metric][0](robot.nv)
    tasks = [replace(task, largest_error="none") for task in case.build(robot, start)]
    controller = Controller(robot, tasks, field, metric=metric, limits=None)
    v0 = 0.3 * np.sin(2.0 + np.arange(robot.nv))
    rollout = simulate(
        controller, q0, v0, duration=1.0, log_period=LOG_PERIOD, integrator=PRECISE
    )
    assert not rollout["damped"].any()
    return controller, rollout


def errors_of(which: str, rollout: Rollout) -> dict[str, Array]:
    """Return every task's error along a motion, by plain Pinocchio."""
    case = TASKS[which]
    kinematics, frame = plain(case.robot), FRAMES[case.robot]
    functions = case.errors(kinematics.placement(rollout.q[0], frame))
    placements = [kinematics.placement(q, frame) for q in rollout.q]
    return {
        name: np.array([e(t, at) for t, at in zip(rollout.t, placements, strict=True)])
        for name, e in functions.items()
    }


@every_task
def test_proposition_1_the_error_is_critically_damped(which: str) -> None:
    """e(t) = (e0 + (e0' + ω e0) t) exp(-ω t), exactly: to 1e-12 of 1 over 1 s."""
    controller, rollout = tracked(which)
    w, t = TASKS[which].frequency, rollout.t[:, None]
    for name, e in errors_of(which, rollout).items():
        np.testing.assert_allclose(rollout[f"task.{name}.error"], e, rtol=0, atol=1e-13)
        e0, e0_dot = e[0], rollout[f"task.{name}.error_rate"][0]
        assert np.linalg.norm(e0) > 0.05
        assert np.linalg.norm(e0_dot) > 0.05
        expected = (e0 + (e0_dot + w * e0) * t) * np.exp(-w * t)
        np.testing.assert_allclose(e, expected, rtol=0, atol=1e-12)
        rate = (e0_dot - w * (e0_dot + w * e0) * t) * np.exp(-w * t)
        np.testing.assert_allclose(
            rollout[f"task.{name}.error_rate"], rate, rtol=0, atol=1e-11
        )
    assert controller.robot.name == TASKS[which].robot


# --- the null space ------------------------------------------------------------------


def moving(robot: Robot, name: str) -> NullSpaceField:
    """Return a field that moves in time: an obstacle, and a vector field with ∂g/∂t."""
    lookout = Lissajous([0.2, 0.3, 0.1], [3.0, 2.0, 4.0], center=[0.7, 0.9, 1.1])
    ball = Obstacle("ball", Sphere(0.1), lookout)
    posture = TargetPosture(home(name), weights=2.0)
    frame = FRAMES[name]

    def wave(state: RobotState) -> Array:
        i = np.arange(robot.nv)
        return 0.5 * np.sin(3.0 * state.t + i) * (1.0 + state.position(frame)[0])

    avoid = PointDistance(NEAR[name], ball, weight=0.05)
    return posture + avoid + 0.8 * FunctionField(wave)


@dataclass(frozen=True)
class Run:
    """A motion with a null space, and the expected one."""

    robot: str
    metric: str
    gain: str

    def __str__(self) -> str:
        return f"{self.robot}-{self.metric}-{self.gain}"

    @property
    def K_N(self) -> Array:
        """The null-space gain; the matrix is neither diagonal nor symmetric."""
        nv = load(self.robot).nv
        if self.gain == "scalar":
            return 6.0 * np.eye(nv)
        rng = np.random.default_rng(nv)
        return np.diag(rng.uniform(5.0, 9.0, nv)) + 0.3 * rng.normal(size=(nv, nv))


KINDS = [
    (metric, gain)
    for metric in METRICS
    for gain in ("scalar", "matrix")
    if (metric, gain) != ("mass matrix", "matrix")  # refused
]
RUNS = [Run(robot, *kind) for robot, kind in covering(FRAMES, KINDS)]
every_run = pytest.mark.parametrize("run", RUNS, ids=str)


@cache
def self_motion(run: Run) -> Rollout:
    """Return half a second of tracking off the path, with a field moving in time."""
    robot, frame, q0 = load(run.robot), FRAMES[run.robot], home(run.robot)
    start = plain(run.robot).placement(q0, frame)
    wanted = gains(7.0)
    if run.robot == "planar3r":
        circle = Circle(0.5, 2.0, start.translation[:2] - [0.5, 0.1])
        task: Task = FramePosition(frame, circle, gains=wanted, axes="xy")
    elif run.robot == "panda":
        path = circle_about(start.translation, OFF)
        task = FramePosition(frame, path, gains=wanted)
    else:
        pose = ComposedPose(circle_about(start.translation, OFF), spin(start))
        task = FramePose(frame, pose, gains=wanted)
    controller = Controller(
        robot,
        [replace(task, largest_error="none")],
        moving(robot, run.robot),
        null_space_gain=run.K_N,
        metric=METRICS[run.metric][0](robot.nv),
        limits=None,
    )
    v0 = 0.5 * np.sin(1.0 + 2.0 * np.arange(robot.nv))
    rollout = simulate(
        controller, q0, v0, duration=DURATION, log_period=LOG_PERIOD, integrator=PRECISE
    )
    assert not rollout["damped"].any()
    return rollout


def null_space_errors(run: Run, rollout: Rollout) -> tuple[Array, Array]:
    """Return e_N = (I - J#J)(g - v) and W along a motion, by plain Pinocchio."""
    kinematics, W_of = plain(run.robot), METRICS[run.metric][1]
    rows = {"planar3r": 2, "panda": 3, "iiwa14": 6}[run.robot]
    errors, metrics = [], []
    for q, v, g in zip(rollout.q, rollout.v, rollout["field.g"], strict=True):
        W = W_of(run.robot, q)
        J = kinematics.jacobians(q, v, FRAMES[run.robot])[0][:rows]
        across = np.linalg.solve(W, J.T)
        x = g - v
        errors.append(x - across @ np.linalg.solve(J @ across, J @ x))
        metrics.append(W)
    return np.array(errors), np.array(metrics)


@every_run
def test_proposition_2_the_null_space_error_decays_as_it_must(run: Run) -> None:
    """Scalar K_N: ‖e_N‖_W = ‖e_N(0)‖_W exp(-K_N t) to 1e-9 of itself, throughout.

    Any K_N: V' = -e_NᵀW K_N e_N with V = ½ e_NᵀW e_N, by differences of eighth order.
    The differences are accurate to 1e-10 of V(0). V decreases from row to row.
    """
    rollout = self_motion(run)
    e_N, W = null_space_errors(run, rollout)
    np.testing.assert_allclose(rollout["null_space_error"], e_N, rtol=0, atol=2e-11)
    V = 0.5 * np.einsum("ti,tij,tj->t", e_N, W, e_N)
    np.testing.assert_allclose(
        rollout["null_space_norm"], np.sqrt(2.0 * V), rtol=1e-9, atol=1e-12
    )
    assert V[0] > 0.005
    if run.gain == "scalar":
        expected = np.sqrt(2.0 * V[0]) * np.exp(-6.0 * rollout.t)
        np.testing.assert_allclose(np.sqrt(2.0 * V), expected, rtol=1e-9, atol=0)
    power = -np.einsum("ti,tij,tj->t", e_N, W @ run.K_N, e_N)
    found = differences(V, LOG_PERIOD)
    np.testing.assert_allclose(found, power[4:-4], rtol=0, atol=1e-9 * V[0])
    assert (np.diff(V) < 0.0).all()


# --- the minimum ---------------------------------------------------------------------


@dataclass(frozen=True)
class Held:
    """An end effector at rest, a cost, and the same cost by hand."""

    robot: str
    task: Callable[[Robot, pin.SE3], Task]
    field: Callable[[Robot], NullSpaceField]
    cost: Callable[[Array], float]
    constraint: Callable[[Array], Array]
    weight: float
    duration: float


def tip_by_hand(angles: Array) -> Array:
    absolute = np.cumsum(angles)
    return np.array([np.cos(absolute).sum(), np.sin(absolute).sum()])


def planar_cost(angles: Array) -> float:
    first = np.array([np.cos(angles[0]), np.sin(angles[0])])
    absolute = angles[0] + angles[1]
    second = first + np.array([np.cos(absolute), np.sin(absolute)])
    ball = np.array([0.3, 1.3])
    away = 1.0 / ((first - ball) @ (first - ball)) + 1.0 / (
        (second - ball) @ (second - ball)
    )
    return float(5.0 * (angles[2] - angles[1]) ** 2 + 0.5 * away)


def posture() -> Array:
    """Return the unconstrained minimum of the Panda's joints."""
    return home("panda") + np.array([0.8, 0.3, -0.9, 0.2, 0.7, -0.1, 0.5])


def centering_and_posture(angles: Array) -> float:
    robot = load("panda")
    low, high = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    away = angles - posture()
    return float(
        2.0 * 0.5 * (((angles - middle) / half) ** 2).sum() + 3.0 * 0.5 * away @ away
    )


def pull(robot: Robot) -> NullSpaceField:
    return 2.0 * JointCentering() + 3.0 * TargetPosture(posture())


def hand(q: Array) -> pin.SE3:
    return plain("panda").placement(q, "panda_tcp")


BALL = Obstacle("ball", Sphere(0.1), Hold([0.3, 1.3, 0.0]))
HELD: dict[str, Held] = {
    "planar3r": Held(
        "planar3r",
        lambda robot, start: FramePosition(
            "tip", Hold(start.translation[:2]), gains=gains(10), axes="xy"),
        lambda robot: EqualJointAngles(["joint2", "joint3"], weight=5.0)
        + PointDistance(["link2", "link3"], BALL, weight=0.5),
        planar_cost, tip_by_hand, 1.0, 4.0),
    "panda position": Held(
        "panda",
        lambda robot, start: FramePosition(
            "panda_tcp", Hold(start.translation), gains=gains(10)),
        pull, centering_and_posture, lambda q: hand(q).translation, 2.0, 4.0),
    "panda pose": Held(
        "panda",
        lambda robot, start: FramePose(
            "panda_tcp", HoldPose(start.translation, start.rotation), gains=gains(10)),
        pull, centering_and_posture,
        lambda q: pin.log6(hand(home("panda")).actInv(hand(q))).vector, 2.0, 4.0),
}  # fmt: skip
HELD_RUNS = covering(HELD, ["mass matrix", "identity"])


@cache
def settled(which: str, metric: str) -> Rollout:
    """Return the motion to the minimum from rest, with the end effector held."""
    case = HELD[which]
    robot, q0 = load(case.robot), home(case.robot)
    start = plain(case.robot).placement(q0, FRAMES[case.robot])
    controller = Controller(
        robot,
        [case.task(robot, start)],
        case.weight * case.field(robot),
        null_space_gain=20.0,
        metric=METRICS[metric][0](robot.nv),
        limits=None,
    )
    return simulate(
        controller,
        q0,
        duration=case.duration,
        log_period=0.01,
        integrator=Dop853(1e-10, 1e-10),
    )


@cache
def constrained_minimum(which: str) -> Array:
    """Return the joint angles of the local minimum near the start, by SciPy."""
    case = HELD[which]
    robot = load(case.robot)
    start = robot.joint_positions(home(case.robot))
    goal = case.constraint(start)
    best = minimize(
        case.cost,
        start,
        constraints={"type": "eq", "fun": lambda x: case.constraint(x) - goal},
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 300},
        jac="3-point",
    )
    assert best.success, best.message
    return np.asarray(best.x)


@pytest.mark.parametrize(("which", "metric"), HELD_RUNS)
def test_proposition_3_q_converges_to_the_constrained_minimum(
    which: str, metric: str
) -> None:
    """In both metrics the same minimum, that of a generic optimiser.

    SLSQP with differences is accurate to 1e-8 here. The residual velocity is Pg, the
    projected gradient, which is zero only at the minimum.
    """
    case, rollout = HELD[which], settled(which, metric)
    minimum = constrained_minimum(which)
    final = rollout["joint_positions"][-1]
    assert (
        np.abs(rollout["joint_positions"][0] - minimum).max() > 0.05
    )  # it had to move
    np.testing.assert_allclose(final, minimum, rtol=0, atol=1e-7)
    assert case.cost(final) <= case.cost(minimum) + 1e-10
    np.testing.assert_allclose(
        case.constraint(final),
        case.constraint(rollout["joint_positions"][0]),
        atol=1e-9,
    )
    # The robot is at rest.
    np.testing.assert_allclose(rollout.v[-1], 0.0, atol=1e-9)


@pytest.mark.parametrize(("which", "metric"), HELD_RUNS)
def test_proposition_3_the_cost_falls(which: str, metric: str) -> None:
    """f' = -‖Pg‖²_W + gᵀW e_N while the end effector is held (docs/law.md).

    Once e_N has decayed f decreases monotonically, to rounding.
    """
    rollout = settled(which, metric)
    case = HELD[which]
    W_of, frame = METRICS[metric][1], FRAMES[case.robot]
    rows = {"planar3r": 2, "panda position": 3, "panda pose": 6}[which]
    f = case.weight * np.array([case.cost(q) for q in rollout["joint_positions"]])
    np.testing.assert_allclose(rollout["field.value"], f, rtol=1e-12)
    predicted = []
    for q, v, g, e_N in zip(
        rollout.q,
        rollout.v,
        rollout["field.g"],
        rollout["null_space_error"],
        strict=True,
    ):
        W, J = W_of(case.robot, q), plain(case.robot).jacobians(q, v, frame)[0][:rows]
        across = np.linalg.solve(W, J.T)
        Pg = g - across @ np.linalg.solve(J @ across, J @ g)
        predicted.append(-Pg @ W @ Pg + g @ W @ e_N)
    found = differences(f, 0.01)
    size = np.abs(predicted).max()
    late = slice(20, -4)  # the first rows move fast for differences of 10 ms
    np.testing.assert_allclose(
        found[late.start - 4 :], predicted[late], rtol=0, atol=1e-7 * size
    )
    assert np.diff(f[100:]).max() < 1e-12
