"""Every known robot, controlled by the same few lines for a simulated second.

It moves from an offset and with a speed to a point, or to a pose if it can, while a
posture and joint centering act in the null space. Errors are taken from the logged
motion by plain Pinocchio.
"""

from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import THOROUGH

from hsp_control import (
    Controller,
    FramePose,
    FramePosition,
    Gains,
    Hold,
    JointCentering,
    NullSpaceField,
    Robot,
    TargetPosture,
    simulate,
)
from hsp_control.cli import robot_table
from hsp_control.cli.robot_table import FLOATING, LOAD_OPTIONS
from hsp_control.common.arrays import Array
from hsp_control.common.resources import bundled_robots
from hsp_control.robot.description.sources import example_robots
from hsp_control.robot.integrators import Rk4
from hsp_control.trajectories import HoldPose

BUNDLED = list(bundled_robots())
EXAMPLES = {k: v for k, v in example_robots().items() if k not in BUNDLED}
FIXED = [name for name, source in EXAMPLES.items() if source.root == "fixed"]
FLOATING_BASE = [name for name, source in EXAMPLES.items() if name not in FIXED]
NO_JOINTS = {"hector", "iris"}  # a drone with a fixed base has no joints
MOBILE = ["tiago", "tiago_pro", "panda"]

FREQUENCY = 5.0  # of the tasks [rad/s], and K_N [1/s]
STEP = 0.004  # of the fourth-order integrator [s]
# Its error after a second: (5 * 0.004)^5/120 a step, 250 times.
TOLERANCE = 3e-8


@dataclass(frozen=True)
class Case:
    """A robot and its loading options."""

    name: str
    options: dict[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return "-".join([self.name, *map(str, self.options.values())])

    def load(self) -> Robot:
        return Robot.load(self.name, **LOAD_OPTIONS.get(self.name, {}), **self.options)


ALIKE = {
    *("bravo7_no_ee", "falcon_bravo7_gripper", "falcon_bravo7_no_ee"),
    *("bluevolta_bravo7_gripper", "bluevolta_bravo7_no_ee", "double_pendulum_simple"),
    *("ur3", "ur3_gripper", "ur3_limited", "ur5_gripper", "ur5_limited", "ur10"),
    *("ur10_limited", "tiago", "tiago_no_hand", "allegro_left_hand", "alexander"),
    *("alex_nub_hands", "alex_sake_hands", "a1", "b1", "go1", "anymal", "g1"),
    *("icub", "simple_humanoid", "so100", "solo8", "talos_box", "talos_full"),
    *("talos_full_box", "talos_legs"),
}
"""Robots with the same joints as another one."""
CASES = [
    *(Case(name) for name in BUNDLED + FIXED if THOROUGH or name not in ALIKE),
    Case("panda", {"locked": {}}),  # fingers free, one of them the other's mimic
    *(Case(name, {"root": "planar"}) for name in MOBILE),
    *(
        Case(n, {"root": "fixed"})
        for n in FLOATING_BASE
        if n not in NO_JOINTS and (THOROUGH or n not in ALIKE)
    ),
]


class Kinematics:
    """The end effector by plain Pinocchio."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.data = robot.model.createData()
        self.index = robot.frame_id(robot.end_effector)

    def placement(self, q: Array) -> pin.SE3:
        pin.framesForwardKinematics(self.robot.model, self.data, q)
        return self.data.oMf[self.index].copy()

    def jacobian(self, q: Array) -> Array:
        pin.computeJointJacobians(self.robot.model, self.data, q)
        return np.array(
            pin.getFrameJacobian(
                self.robot.model,
                self.data,
                self.index,
                pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
            )
        )


@dataclass
class Start:
    """A robot's start, and the rows of its end effector's Jacobian that are tracked."""

    q: Array
    rows: list[int]
    sigma_min: float


def ranges(robot: Robot) -> tuple[Array, Array]:
    """Return the limits, or ±π where there are none."""
    lower, upper = robot.position_limits()
    there = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
    return np.where(there, lower, -np.pi), np.where(there, upper, np.pi)


def find_start(
    robot: Robot, rng: np.random.Generator, choices: list[list[int]]
) -> Start:
    """Return home if one of the choices of rows is well conditioned there.

    Otherwise return the best of fifty random configurations.
    """
    kinematics = Kinematics(robot)

    def judge(q: Array) -> Start:
        J = kinematics.jacobian(q)
        found = [
            Start(q, rows, float(np.linalg.svd(J[rows], compute_uv=False)[-1]))
            for rows in choices
        ]
        return max(found, key=lambda start: start.sigma_min)

    home = judge(robot.home())
    if home.sigma_min > 0.1:
        return home
    low, high = ranges(robot)
    drawn = [
        judge(robot.integrate(robot.neutral(), rng.uniform(low, high)))
        for _ in range(50)
    ]
    return max(drawn, key=lambda start: start.sigma_min)


def hold_and_centre(robot: Robot, kind: str) -> float:
    """Check both propositions on a second of motion; return the least sigma_min."""
    rng = np.random.default_rng(7)
    kinematics = Kinematics(robot)
    # At least one degree of freedom is left to the null space.
    axes = min(robot_table.abilities(robot)["position"], robot.nv - 1)
    choices = [list(c) for c in combinations(range(3), axes)]
    start = find_start(robot, rng, choices if kind == "position" else [list(range(6))])
    q0, rows = start.q, start.rows

    low, high = ranges(robot)
    reach = np.minimum(1.0, 0.5 * (high - low))  # fingers move by centimetres

    def off(size: float) -> Array:
        return size * reach * rng.uniform(-1.0, 1.0, robot.nv)

    goal = kinematics.placement(robot.integrate(q0, off(0.1)))  # so it can be reached
    gains = Gains(natural_frequency=FREQUENCY)
    task: Any
    if kind == "position":
        letters = "".join("xyz"[i] for i in rows)
        target = Hold(goal.translation[rows])
        task = FramePosition(
            robot.end_effector, target, gains=gains, axes=letters, name="hand"
        )
    else:
        task = FramePose(
            robot.end_effector,
            HoldPose(goal.translation, goal.rotation),
            gains=gains,
            name="hand",
        )
    pull: NullSpaceField = TargetPosture(robot.integrate(q0, off(0.5)))
    if np.isfinite(robot.position_limits()[0]).any() and (high - low < 6.28).any():
        pull = pull + JointCentering(weights=reach**2)
    task = replace(task, largest_error="none")
    controller = Controller(robot, [task], pull, null_space_gain=FREQUENCY, limits=None)
    rollout = simulate(
        controller, q0, off(0.3), duration=1.0, log_period=0.1, integrator=Rk4(STEP)
    )
    assert not rollout["damped"].any()
    assert np.isfinite(rollout.tau).all()

    e, e_N = [], []
    for q, v, g in zip(rollout.q, rollout.v, rollout["field.g"], strict=True):
        here = kinematics.placement(q)
        error = np.concatenate(
            [
                goal.translation - here.translation,
                -pin.log3(goal.rotation.T @ here.rotation),
            ]
        )
        e.append(error[rows])
        J = kinematics.jacobian(q)[rows]
        e_N.append((g - v) - J.T @ np.linalg.solve(J @ J.T, J @ (g - v)))
    t = rollout.t[:, None]
    # e' = -J v for a target at rest; an orientation's error in its own coordinates.
    e0, e0_dot = e[0], rollout["task.hand.error_rate"][0]
    if kind == "position":
        J = kinematics.jacobian(q0)[rows]
        np.testing.assert_allclose(e0_dot, -J @ rollout.v[0], rtol=0, atol=1e-13)
    assert np.linalg.norm(e0) > 1e-3
    expected = (e0 + (e0_dot + FREQUENCY * e0) * t) * np.exp(-FREQUENCY * t)
    scale = np.linalg.norm(e0) + np.linalg.norm(e0_dot) / FREQUENCY
    np.testing.assert_allclose(np.array(e), expected, rtol=0, atol=TOLERANCE * scale)

    norms = np.linalg.norm(e_N, axis=1)
    assert norms[0] > 1e-2
    np.testing.assert_allclose(
        norms, norms[0] * np.exp(-FREQUENCY * rollout.t), rtol=TOLERANCE, atol=0
    )
    return float(rollout["singular_values"].min())


@pytest.mark.parametrize("case", CASES, ids=str)
def test_both_propositions(case: Case) -> None:
    robot = case.load()
    posed = robot.nv > 6 and robot_table.abilities(robot)["pose"] == 6
    if posed:
        hold_and_centre(robot, "pose")
    if THOROUGH or not posed:
        hold_and_centre(robot, "position")


# --- the end effector ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "frame"),
    [
        ("allegro_right_hand", "link_11.0_tip"),  # a finger, since there is no arm
        ("baxter", "right_gripper"),
        ("bravo7_no_ee", "end_effector_ball"),
        ("finger_edu", "finger_tip_link"),
        ("go2", "RR_foot"),
        ("kinova", "j2s6s200_end_effector"),  # its fingers are fixed frames behind it
        ("panda", "panda_tcp"),
        ("panda_collision", "panda_hand_tcp"),  # the base of the fingers
        ("talos_full", "gripper_right_base_link"),
        ("tiago", "hand_tool_link"),  # not the tip of its ring finger
        ("tiago_pro", "gripper_right_base_link"),
        ("ur5", "tool0"),
        ("xarm7", "link_eef"),
        ("z1", "gripperStator"),  # not the moving jaw
    ],
)
def test_end_effector_is_the_frame_that_a_person_would_name(
    name: str, frame: str
) -> None:
    if name not in BUNDLED:
        pytest.importorskip("example_robot_data")
    robot = Robot.load(name, **LOAD_OPTIONS.get(name, {}))
    assert robot.end_effector == frame
    assert frame in robot.frame_names


# --- the table -----------------------------------------------------------------------


def test_every_robot_is_driven_or_listed_with_its_reason() -> None:
    pytest.importorskip("example_robot_data")
    from example_robot_data.robots_loader import ROBOTS

    rows = {row.name: row for row in robot_table.rows()}
    assert set(rows) == {*ROBOTS, *BUNDLED}
    for name, row in rows.items():
        drivable = row.nv is not None and row.root != "free_flyer"
        assert drivable == (name in BUNDLED + FIXED), name
        if drivable:
            assert row.position > 0
            assert row.end_effector
        else:
            assert FLOATING in row.note or name == "cassie"
    assert "no URDF" in rows["cassie"].note
    # A robot that does not load as it is names the options that it needs.
    for name in LOAD_OPTIONS:
        assert "load it with `" in rows[name].note
