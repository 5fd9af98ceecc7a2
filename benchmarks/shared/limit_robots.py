"""Violations of limits, and how fast efforts change, of ten arms."""

from typing import NamedTuple

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import own_limits
from hsp_control.control.actuation import Status
from hsp_control.robot.integrators import Rk4
from shared.rollouts import PERIODS, ROUNDING, STEP, beyond, run_parallel

ROBOTS = (
    *("panda", "iiwa14", "ur5", "ur10", "xarm7", "z1", "kinova"),
    *("talos_arm", "baxter", "alex_nub_hands"),
)


class Measured(NamedTuple):
    """Measurements of a rollout.

    Attributes:
        status: The status of each step.
        violated: Number of steps beyond the limits of effort, its rate, speed and
            position, shape (4,).
        excess: Largest excess of a position [rad or m]; negative: the remaining range.
        changes: Largest change of an effort in every millisecond, as a part of its
            limit; empty where periods are longer, or the rate is limited.
    """

    status: Array
    violated: Array
    excess: float
    changes: Array


def roll_out(item: tuple[str, int]) -> Measured:
    """Run a random rollout of 0.8 s, mostly beyond the limits, and measure it.

    Limits: 70 to 100 % of the robot's efforts, 10 to 60 % of its speeds, its ranges,
    and gravity within the efforts (not with mimic joints); with every third seed twenty
    times the efforts a second. Task: a circle of 15 cm radius at 1 to 8 rad/s, up to a
    metre away; with odd seeds an orientation below it.
    """
    name, seed = item
    robot, rng = hsp.Robot.load(name), np.random.default_rng(seed)
    own, period = own_limits(robot), PERIODS[seed % 4]
    limits = hsp.Limits(
        effort=own.effort * rng.uniform(0.7, 1.0),
        velocity=own.velocity * rng.uniform(0.1, 0.6),
        effort_rate=None if seed % 3 else own.effort * 20.0,
        static_effort=None if robot.mimics else 1.0,
    )
    q0 = holdable(robot, 0.6 * own.effort, rng)
    hand = robot.end_effector
    start = robot.state(0.0, q0, np.zeros(robot.nv)).position(hand)
    center = start + rng.uniform(0.0, 0.4) * rng.normal(size=3)
    path = hsp.Circle(0.15, rng.uniform(1.0, 8.0), center, normal=rng.normal(size=3))
    gains = hsp.Gains(natural_frequency=rng.uniform(5.0, 12.0))
    tasks: list[hsp.Task] = [hsp.FramePosition(hand, path, gains=gains)]
    if seed % 2:
        tasks.append(hsp.FrameOrientation(hand, priority=2))
    controller = hsp.Controller(robot, tasks, hsp.JointCentering(), limits=limits)
    rollout = hsp.simulate(
        controller,
        q0,
        duration=0.8,
        control_period=period,
        log_period=period,
        integrator=Rk4(STEP),
    )
    assert controller.limits is not None
    excess = beyond(rollout, controller.limits, period)
    steps = np.abs(np.diff(rollout["tau"], axis=0)) / controller.limits.effort
    measured = period == STEP and seed % 3
    return Measured(
        rollout["status"],
        np.array([(each > ROUNDING).any(axis=1).sum() for each in excess]),
        float(excess[3].max()),
        steps.max(axis=1) if measured else np.zeros(0),
    )


def holdable(robot: hsp.Robot, efforts: Array, rng: np.random.Generator) -> Array:
    """Return a random configuration where gravity needs less than these efforts."""
    rest = np.zeros(robot.nv)
    while True:
        q: Array = robot.random_configuration(rng)
        if (np.abs(robot.inverse_dynamics(q, rest, rest)) < efforts).all():
            return q


def row(name: str, runs: list[Measured]) -> str:
    """Return a line of the table."""
    status = np.concatenate([run.status for run in runs])
    violated = np.sum([run.violated for run in runs], axis=0)
    changes = 100.0 * np.concatenate([run.changes for run in runs])
    most = np.quantile(changes, [0.5, 0.99, 0.999, 1.0])
    return (
        f"| {name} | {len(status)} | {100.0 * (status == Status.LIMITED).mean():.0f} % "
        f"| {(status == Status.RELAXED).sum()} | {', '.join(map(str, violated))} | "
        f"{max(run.excess for run in runs):.2g} | "
        f"{', '.join(f'{each:.2g}' for each in most)} |\n"
    )


def table(count: int) -> str:
    """Run so many rollouts of each robot, and return the table."""
    lines = (
        "| robot | steps | limited | relaxed | violations: effort, rate, velocity, "
        "position | largest excess of a position (negative: margin) [rad or m] | "
        "change of an effort in 1 ms, % of its limit: median, 99 %, 99.9 %, most |\n"
        "|---|--:|--:|--:|--:|--:|--:|\n"
    )
    for name in ROBOTS:
        seeds = [(name, seed) for seed in range(count)]
        lines += row(name, run_parallel(roll_out, seeds, name))
    return lines
