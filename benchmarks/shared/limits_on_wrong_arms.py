"""Excess over limits of arms with model errors: random cases.

Masses ±20 %, centres ±10 mm, friction, an undeclared load of 1 kg, efforts
2 ms late and then with a lag of 3 ms, a velocity with noise of 0.01 rad/s, at 1 kHz.
A case drives joints against their ranges: a pose, a posture, or a field that pushes.
Without compensation, and with a momentum observer. How far the true position
leaves its range, the speed its limit, and what the status reported: a part of
`limit_rollouts.py`.
"""

import warnings
from functools import cache
from typing import Any, NamedTuple

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.actuation import Status
from hsp_control.control.compensation import Compensation, MomentumObserver
from hsp_control.simulation import plants
from hsp_control.simulation.plants.drives import Drive, Driving
from hsp_control.simulation.plants.model_changes import MotorInertia, changed
from hsp_control.trajectories import ComposedPose, HoldOrientation
from shared.edge_cases import Arm
from shared.rollouts import run_parallel

PERIOD, DURATION, BEGIN = 1e-3, 3.0, 0.2  # [s]
NEAR, FAR = (0.05, 1.0), 2.0  # of a start, from the end of a joint's range [rad]
BEYOND = 0.3  # of a target, behind it [rad]
DELAY, LAG, NOISE, LOAD = 2, 0.003, 0.01, 1.0  # [periods, s, rad/s, kg]
COULOMB, VISCOUS = 0.005, 0.002  # of a joint's largest effort, at 1 rad/s
KINDS = ("pose", "posture", "field")
EASY = ("held", "circle")  # away from the ends
TOLD = ("told", "missed", "false")
ROBOTS = ("panda", "iiwa14", "xarm7", "ur5")
OBSERVER = Compensation(momentum_observer=MomentumObserver(30.0))


class Lag(Drive, type="lag_of_first_order"):
    """Efforts follow with a lag of first order."""

    time: float
    """Its time constant [s]."""

    def begin(self, robot: hsp.Robot, random: np.random.Generator) -> Driving:
        """Return the filter, which begins with the first effort."""
        share, now = 1.0 - np.exp(-PERIOD / self.time), None

        def drive(tau: Array) -> tuple[Array, float]:
            nonlocal now
            now = tau.copy() if now is None else now + share * (tau - now)
            return now, 0.0

        return drive


def plant(arm: Arm, seed: int) -> plants.RigidBody:
    """Return an arm that differs from its model."""
    most = np.asarray(arm.robot.model.effortLimit)
    center = tuple(np.random.default_rng([seed, 1]).uniform(-0.05, 0.05, 3))
    return plants.RigidBody(
        inertias=plants.Inertias(random_mass=0.2, random_com=0.01),
        payload=plants.Payload(arm.frame, LOAD, center=center, radius=0.03),
        friction=plants.Friction(COULOMB * most, VISCOUS * most),
        sensors=[plants.VelocityNoise(NOISE)],
        drives=[plants.EffortDelay(DELAY), Lag(LAG)],
        seed=seed,
    )


def start_of(arm: Arm, rng: np.random.Generator) -> Array:
    """Return displacements from neutral to start from: some joints near their ends."""
    x, nv = arm.start(rng), arm.robot.nv
    away = rng.uniform(*NEAR, nv)
    end = np.where(rng.random(nv) < 0.5, arm.lower + away, arm.upper - away)
    near = np.where(rng.random(nv) < 0.4, end, x)
    return np.clip(near, arm.lower + 0.02, arm.upper - 0.02)


def beyond(arm: Arm, start: Array, rng: np.random.Generator) -> Array:
    """Return a posture whose joints are partly behind the nearer end of their range."""
    low, high = np.maximum(arm.lower, start - 1.0), np.minimum(arm.upper, start + 1.0)
    posture = rng.uniform(low, high)
    end = np.where(
        start < 0.5 * (arm.lower + arm.upper), arm.lower - BEYOND, arm.upper + BEYOND
    )
    out = (np.abs(end - start) < FAR) & (rng.random(arm.robot.nv) < 0.7)
    return np.where(out, end, posture)


def controller(arm: Arm, kind: str, q0: Array, rng: np.random.Generator) -> Any:
    """Return a controller that drives joints against their ranges."""
    start = arm.robot.joint_positions(q0)
    goal = beyond(arm, start, rng)
    if kind in EASY:
        x: Any = hsp.Circle(0.08, 2.0) if kind == "circle" else hsp.Hold()
        task: Any = hsp.FramePose(arm.frame, ComposedPose(x), blend=1.0)
        return hsp.Controller(arm.robot, [task], hsp.JointCentering(), start=q0)
    if kind == "posture":
        task = hsp.JointPosture(goal)
        return hsp.Controller(arm.robot, [task], start=q0)
    if kind == "field":
        pose, _ = arm.at(start)  # the same, held
        held = ComposedPose(hsp.Hold(pose.translation), HoldOrientation(pose.rotation))
        push = hsp.fields.FunctionField(lambda state: goal * 3.0)
        task = hsp.FramePose(arm.frame, held)
        return hsp.Controller(arm.robot, [task], push, start=q0)
    pose, _ = arm.at(goal)
    there = ComposedPose(hsp.Hold(pose.translation), HoldOrientation(pose.rotation))
    task = hsp.FramePose(arm.frame, there, blend=0.3)
    return hsp.Controller(arm.robot, [task], hsp.JointCentering(), start=q0)


class Setting(NamedTuple):
    """The subject of a row of the table.

    Attributes:
        robot: Its name.
        words: The remedy for the errors.
        compensation: That.
        kinds: Kinds of cases, in turns.
        rotors: Inertia of rotors, of the model and of the arm [kg m²].
    """

    robot: str
    words: str
    compensation: Compensation | None = OBSERVER
    kinds: tuple[str, ...] = KINDS
    rotors: float = 0.0


SETTINGS = [
    *(Setting(robot, "observer") for robot in ROBOTS),
    *(
        Setting(robot, f"observer, rotors of {rotors} kg m²", rotors=rotors)
        for robot, rotors in (("panda", 0.1), ("iiwa14", 0.1), ("xarm7", 0.05))
    ),
    *(Setting(robot, "nothing; held, circle", None, EASY) for robot in ROBOTS),
]


@cache
def arm_of(robot: str, rotors: float) -> Arm:
    """Return an arm whose model has such rotors, cached per process."""
    arm = Arm(robot)
    if rotors:
        arm.robot = changed(arm.robot, [MotorInertia(rotors)])
    return arm


def measure(item: tuple[Setting, int]) -> dict[str, Any]:
    """Return the numbers of one run."""
    (robot, _, compensation, kinds, rotors), seed = item
    arm = arm_of(robot, rotors)
    rng = np.random.default_rng([seed, 0])
    kind = kinds[seed % len(kinds)]
    near = kind not in EASY
    q0 = arm.configuration(start_of(arm, rng) if near else arm.start(rng))
    made = controller(arm, kind, q0, rng)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = hsp.simulate(
            made, q0, duration=DURATION, control_period=PERIOD, log_period=PERIOD,
            plant=plant(arm, seed), compensation=compensation, check_rate=False,
        )  # fmt: skip
    out = run["position_excess"].max(axis=1)
    fast = (run["velocity_excess"] / made.limits.velocity).max(axis=1)
    told = run["status"] > Status.RELAXED
    return {
        "out": out.max(),
        "fast": fast.max(),
        "told": int(told.sum()),
        "missed": int(((out > 1.1e-3) & ~told).sum()),
        "false": int((told & (out < 1e-4) & (fast < 1e-4)).sum()),
    }


def table(count: int) -> str:
    """Run so many cases of each setting, and return the table."""
    lines = (
        "| robot | against the errors | beyond a range, half / most [mrad] | by more "
        "than 5 mrad | above a speed, most | rows reported, missed, "
        "reported without need |\n"
        "|---|---|--:|--:|--:|--:|\n"
    )
    for setting in SETTINGS:
        items = [(setting, seed) for seed in range(count)]
        found = run_parallel(measure, items, f"{setting.robot}, {setting.words}")
        out = 1e3 * np.array([run["out"] for run in found])
        lines += (
            f"| {setting.robot} | {setting.words} | {np.median(out):.2f} / "
            f"{out.max():.1f} | {(out > 5.0).sum()} of {count} | "
            f"{100 * max(run['fast'] for run in found):.1f} % | "
            f"{', '.join(str(sum(run[k] for run in found)) for k in TOLD)} |\n"
        )
    return lines
