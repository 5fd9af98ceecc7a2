"""Singularities: the law is exact away from them, and bounded at them.

A singular value s of J L⁻ᵀ below the threshold ε is inverted by s(2 - s²/ε²)/ε² instead
of 1/s, so ‖J#‖ ≤ 1.0887/ε. With κ = 1.0887/ε and x = g - v, for the identity metric,

    a = J#(a_x - J'v) + (I - J#J)(g' + K_N e_N - J'ᵀ J#ᵀ x),
    |a| ≤ κ(|a_x| + ‖J'‖|v|) + |g'| + K_N|x| + κ‖J'‖|x|,   |tau| ≤ ‖M‖|a| + |N|.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from loaded_robots import load
from places import THOROUGH

from hsp_control import (
    Controller,
    ControlOutput,
    FramePose,
    FramePosition,
    Gains,
    Robot,
    RobotState,
    Rollout,
    TargetPosture,
    Task,
    simulate,
)
from hsp_control.common.arrays import Array
from hsp_control.edge.shares import FAR, NEAR
from hsp_control.robot.integrators import Rk4
from hsp_control.trajectories import (
    CallableOrientation,
    CallableTrajectory,
    ComposedPose,
    MinimumJerk,
)

DEFAULT = 0.03
FREQUENCY = 10.0  # of the tasks [rad/s], and K_N [1/s]
LIMIT = np.sqrt(32.0 / 27.0)  # of s q(s²) ε: 1.0887


def bound(state: RobotState, output: ControlOutput, threshold: float) -> float:
    """Return the bound on |a| of this module's first lines, at a state."""
    kappa = LIMIT / threshold
    x = float(np.linalg.norm(output.field.g - state.v))
    turning = float(np.linalg.norm(output.task.jacobian_dot, 2))
    return (
        kappa * float(np.linalg.norm(output.task.acceleration))
        + kappa * turning * (float(np.linalg.norm(state.v)) + x)
        + float(np.linalg.norm(output.field.g_dot))
        + FREQUENCY * x
    )


# --- motions through singularities ---------------------------------------------------


@dataclass(frozen=True)
class Passage:
    """A motion into a singularity and out of it again.

    Attributes:
        robot: The robot.
        task: The task, whose reference passes through it and back.
        start: The initial configuration, shape (nq,).
        duration: Its duration, with time to recover [s].
        threshold: The singularity threshold.
        effort: Bound on the largest effort [N·m].
        step: The integrator's step [s].
    """

    robot: Robot
    task: Task
    start: Array
    duration: float
    threshold: float
    effort: float
    step: float = 0.0005

    def controller(self, threshold: float) -> Controller:
        """Return a controller whose field attracts the joints to their start.

        The feedback is linear, so that the threshold is constant.
        """
        task: Any = self.task
        return Controller(
            self.robot,
            [replace(task, largest_error="none")],
            TargetPosture(self.start),
            null_space_gain=FREQUENCY,
            singularity_threshold=threshold,
            limits=None,
        )

    def run(self, threshold: float, control_period: float | None = None) -> Rollout:
        """Return the motion; it starts with a speed."""
        v0 = 0.05 * np.sin(1.0 + np.arange(self.robot.nv))
        return simulate(
            self.controller(threshold),
            self.start,
            v0,
            duration=self.duration,
            control_period=control_period,
            log_period=0.01,
            integrator=Rk4(self.step),
        )


def stretched_planar_arm() -> Passage:
    """The tip's reference leaves the reachable disk of 3 m by 0.4 m, and returns."""
    robot = load("planar3r")
    q0 = robot.integrate(robot.neutral(), np.array([0.6, -0.9, -0.7]))
    here = robot.state(0.0, q0, np.zeros(3)).position("tip")[:2].copy()
    away = 3.4 * here / np.linalg.norm(here)
    path = MinimumJerk([here, away, away, here], [0.0, 1.5, 2.0, 3.5])
    task = FramePosition(
        "tip", path, gains=Gains(natural_frequency=FREQUENCY), axes="xy"
    )
    return Passage(robot, task, q0, 5.0, 0.1, effort=1.5e3)


def panda_out_of_reach(threshold: float) -> Passage:
    """The hand is commanded to a point 15 cm out of reach, and back."""
    robot = load("panda")
    q0, shoulder = robot.home(), np.array([0.0, 0.0, 0.333])
    here = robot.state(0.0, q0, np.zeros(7)).position("panda_tcp").copy()
    ray = (here - shoulder) * [1.0, 1.0, 0.0] + [0.0, 0.0, 0.1]
    away = shoulder + 1.05 * ray / np.linalg.norm(ray)
    path = MinimumJerk([here, away, away, here], [0.0, 1.5, 2.0, 3.5])
    task = FramePosition("panda_tcp", path, gains=Gains(natural_frequency=FREQUENCY))
    effort = 2e3 if threshold < 0.1 else 2e2
    return Passage(robot, task, q0, 5.0, threshold, effort)


def driven(
    name: str, frame: str, joints: dict[int, float], swing: list[float]
) -> Passage:
    """A pose reference along a joint motion through a singularity and back."""
    robot = load(name)
    state, still = RobotState(robot), np.zeros(robot.nv)
    singular = robot.home()
    singular[list(joints)] = list(joints.values())
    span = np.array(swing)
    there_and_back = 4.0  # [s]

    @lru_cache(maxsize=256)
    def hand(t: float) -> tuple[Array, Array]:
        u = np.clip(t / there_and_back, 0.0, 1.0)
        angle = 2.0 * np.pi * u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)
        there = state.update(0.0, singular + span * np.cos(angle), still).frame(frame)
        return there.position.copy(), there.rotation.copy()

    path = ComposedPose(
        CallableTrajectory(lambda t: hand(t)[0], 3),
        CallableOrientation(lambda t: hand(t)[1]),
    )
    task = FramePose(frame, path, gains=Gains(natural_frequency=FREQUENCY))
    return Passage(robot, task, singular + span, 5.0, DEFAULT, effort=80.0, step=0.0025)


PASSAGES: dict[str, Callable[[], Passage]] = {
    "planar arm stretched": stretched_planar_arm,
    "panda out of reach": lambda: panda_out_of_reach(DEFAULT),
    "panda out of reach, more damping": lambda: panda_out_of_reach(0.1),
    # The wrist's centre is on the line through the shoulder and the offset elbow.
    "panda elbow": lambda: driven(
        *("panda", "panda_tcp", {3: -0.466}), [0.1, -0.15, 0.1, 0.5, -0.1, 0.2, 0.1]
    ),
    # Three axes of the wrist in a plane with the elbow's. Self-motion goes around it.
    "panda wrist": lambda: driven(
        *("panda", "panda_tcp", {4: np.pi / 2.0, 5: -0.205}),
        [0.1, -0.1, 0.1, 0.1, -0.3, 0.5, 0.1],
    ),
    "iiwa14 wrist": lambda: driven(
        *("iiwa14", "iiwa_link_ee", {4: np.pi / 2.0, 5: 0.0}),
        [0.1, -0.1, 0.1, 0.1, -0.3, 0.6, 0.1],
    ),
}
USUAL = ["planar arm stretched", "panda elbow"]
every_passage = pytest.mark.parametrize("which", PASSAGES if THOROUGH else USUAL)


@cache
def passed(which: str) -> tuple[Passage, Rollout]:
    passage = PASSAGES[which]()
    return passage, passage.run(passage.threshold)


def damped_part(rollout: Rollout) -> tuple[int, int]:
    """Return the first and the last damped row."""
    (rows,) = np.nonzero(rollout["damped"])
    return int(rows[0]), int(rows[-1])


def decayed(rollout: Rollout, name: str, rows: slice) -> tuple[Array, Array]:
    """Return e at some rows, and the law's decay from the first of them."""
    t = (rollout.t[rows] - rollout.t[rows][0])[:, None]
    e, e_dot = rollout[f"task.{name}.error"][rows], rollout[f"task.{name}.error_rate"]
    slope = e_dot[rows][0] + FREQUENCY * e[0]
    return e, (e[0] + slope * t) * np.exp(-FREQUENCY * t)


@every_passage
def test_the_law_is_exact_until_the_threshold_is_met(which: str) -> None:
    """Both propositions, to 1e-5 of the initial errors, until the singularity.

    The difference is the integrator's error: joint speeds grow within milliseconds at
    the end.
    """
    passage, rollout = passed(which)
    first, _ = damped_part(rollout)
    assert first > 40
    e, expected = decayed(rollout, passage.task.name, slice(0, first))
    assert np.linalg.norm(e, axis=1).max() > 1e-3  # there was an error to reduce
    np.testing.assert_allclose(e, expected, rtol=0, atol=1e-5 * np.abs(e).max())
    norm, t = rollout["null_space_norm"][:first], rollout.t[:first]
    np.testing.assert_allclose(
        norm, norm[0] * np.exp(-FREQUENCY * t), rtol=0, atol=1e-5 * norm[0]
    )


@every_passage
def test_effort_is_bounded_in_the_singularity(which: str) -> None:
    """By the bound that 1.0887/ε gives at every row, and by a number for the motion."""
    passage, rollout = passed(which)
    controller = passage.controller(passage.threshold)
    robot, state = controller.robot, RobotState(controller.robot)
    tightest = 0.0
    for i in range(len(rollout)):
        output = controller.compute(
            state.update(rollout.t[i], rollout.q[i], rollout.v[i])
        )
        a = float(np.linalg.norm(output.acceleration))
        limit = bound(state, output, passage.threshold)
        assert a <= limit
        M = state.mass_matrix
        heaviest = float(np.linalg.eigvalsh(np.triu(M) + np.triu(M, 1).T)[-1])
        gravity = float(np.linalg.norm(state.nonlinear_effects))
        assert np.linalg.norm(output.tau) <= heaviest * limit + gravity
        tightest = max(tightest, a / limit)
        if not output.damped:
            task = output.task
            answer = task.jacobian @ output.acceleration + task.jacobian_dot @ state.v
            scale = 1.0 + limit * passage.threshold
            np.testing.assert_allclose(answer, task.acceleration, atol=1e-11 * scale)
    assert tightest > 0.02  # so that the bound is tight
    assert np.isfinite(rollout.tau).all()
    assert np.abs(rollout.tau).max() < passage.effort
    assert robot is passage.robot


# --- random starts -------------------------------------------------------------------

STARTS = 1250 if THOROUGH else 100
ROBOTS = {
    "planar3r": "xy", "panda": "pose", "iiwa14": "pose", "ur5": "xyz", "kinova": "xyz",
    "xarm7": "pose", "talos_arm": "pose", "tiago_no_hand": "pose",
}  # fmt: skip


def random_start(robot: Robot, rng: np.random.Generator) -> Array:
    """Return a configuration; every other one on singularities of all kinds.

    Joints at multiples of a right angle align axes, exactly or to 1e-1 ... 1e-12.
    """
    q = robot.joint_positions(robot.random_configuration(rng))
    if rng.random() < 0.5:
        some = rng.random(robot.nv) < 0.7
        q[some] = np.pi / 2.0 * rng.integers(-1, 2, size=int(some.sum()))
        q += rng.choice([0.0, 10.0 ** rng.uniform(-12.0, -1.0)]) * rng.normal(
            size=robot.nv
        )
    return robot.integrate(robot.neutral(), q)


class Target:
    """A task whose target rests, and is set anew for every start."""

    def __init__(self, robot: Robot, kind: str) -> None:
        frame, gains = robot.end_effector, Gains(natural_frequency=FREQUENCY)
        self.frame = frame
        self.position, self.rotation = np.zeros(3), np.eye(3)
        axes = [] if kind == "pose" else ["xyz".index(axis) for axis in kind]
        still = np.zeros(len(axes) or 3)
        position = CallableTrajectory(
            lambda t: self.position[axes or slice(None)],
            len(still),
            velocity=lambda t: still,
            acceleration=lambda t: still,
        )
        self.task: Task
        if kind == "pose":
            pose = ComposedPose(position, CallableOrientation(lambda t: self.rotation))
            self.task = FramePose(frame, pose, gains=gains)
        else:
            self.task = FramePosition(frame, position, gains=gains, axes=kind)

    def move(self, state: RobotState, away: Array, turn: Array) -> None:
        """Move the target by ``away`` [m] and rotate it by ``turn`` [rad] off the
        frame."""
        here = state.frame(self.frame)
        self.position = here.position + away
        self.rotation = here.rotation @ pin.exp3(turn)


def loaded(name: str) -> Robot:
    if name not in {"planar3r", "panda", "iiwa14"}:
        pytest.importorskip("example_robot_data")
    return load(name)


@pytest.mark.parametrize("largest", ["none", "robot"])
@pytest.mark.parametrize("name", ROBOTS)
def test_random_starts(name: str, largest: Any) -> None:
    """20,000 if thorough: finite, bounded, and exact if reported undamped.

    Half of them with a threshold that adapts to the feedback: most of these are damped.
    """
    robot = loaded(name)
    rng = np.random.default_rng(sum(map(ord, name)))
    target = Target(robot, ROBOTS[name])
    field = TargetPosture(robot.random_configuration(rng))
    task: Any = replace(target.task, largest_error=largest)
    controller = Controller(
        robot, [task], field, null_space_gain=FREQUENCY, limits=None
    )
    state = RobotState(robot)
    singular = 0
    for _ in range(STARTS):
        q, v = random_start(robot, rng), rng.normal(size=robot.nv)
        state.update(0.0, q, v)
        target.move(state, rng.normal(size=3), rng.uniform(-1.0, 1.0, 3))
        output = controller.compute(state)
        a, task = output.acceleration, output.task
        limit = bound(state, output, DEFAULT)
        assert np.isfinite(output.tau).all()
        assert np.linalg.norm(a) <= limit
        values = controller.diagnose().singular_values
        (threshold,) = controller.active_stack.law.thresholds
        # In the interior the law is exact for either threshold.
        stretched = controller.active_stack.law.problem.stretched
        near = max(NEAR * robot.size, 2.0 * DEFAULT)
        middle = values[-1] > near and stretched.max() < FAR
        if largest == "robot":
            assert not (output.damped and (middle or values[-1] >= threshold))
            assert output.damped or middle or values[-1] >= 0.999 * threshold
        else:
            assert bool(output.damped) == (values[-1] < threshold)
        singular += bool(output.damped)
        # ‖e_N‖ ≤ ‖g - v‖: a projection where exact, a contraction where damped.
        x = output.field.g - v
        assert np.linalg.norm(output.null_space_error) <= np.linalg.norm(x) * (1 + 1e-9)
        if not output.damped:
            answer = task.jacobian @ a + task.jacobian_dot @ v
            np.testing.assert_allclose(
                answer, task.acceleration, rtol=0, atol=1e-10 * (1.0 + limit * DEFAULT)
            )
            left = task.jacobian @ output.null_space_error
            np.testing.assert_allclose(left, 0.0, rtol=0, atol=1e-10)
    if largest == "none":
        assert STARTS // 80 <= singular <= STARTS - STARTS // 80  # of both kinds
