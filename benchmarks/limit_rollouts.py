"""Count violations of limits: rollouts of a Panda, of ten arms, of wrong ones; pushes.

    .venv/bin/python benchmarks/limit_rollouts.py [--count N] [PART ...]

A part is a section of results/limits.md; without a name all run, hours. Numbers are
computed from the log: positions, velocities and efforts of every period, and the
differences of efforts.
"""

import argparse
from functools import cache
from typing import NamedTuple

import numpy as np
from shared import limit_pushes, limit_robots, limits_on_wrong_arms
from shared.marked_sections import RESULTS, replace_section
from shared.rollouts import PERIODS, ROUNDING, STEP, beyond, run_parallel

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import RobotLimits, own_limits
from hsp_control.control.actuation import Status
from hsp_control.robot.integrators import Rk4

EXCESS = ("effort [N·m]", "effort rate [N·m/s]", "velocity [rad/s]", "position [rad]")


class Arm(NamedTuple):
    """Measurements of a rollout of the arm.

    Attributes:
        completed: Whether it ran to its end.
        rows: Number of steps.
        violated: Number of steps beyond each limit, shape (4,).
        excess: Largest excess over each limit, shape (4,).
        used: Largest ratio of a value to each limit, shape (4,).
        limited: Number of steps at which limits changed the law's acceleration.
        relaxed: Number of steps at which limits contradicted each other.
        relaxation: Largest relaxation of a barrier [rad/s²].
    """

    completed: bool
    rows: int
    violated: Array
    excess: Array
    used: Array
    limited: int
    relaxed: int
    relaxation: float


@cache
def panda() -> hsp.Robot:
    """Return the arm, cached per process."""
    return hsp.Robot.load("panda")


def draw(seed: int) -> tuple[hsp.Controller, RobotLimits, Array]:
    """Return a random controller whose limits become active, its limits and a start.

    Limits: 70 to 100 % of the arm's efforts, 20 to 50 % of its speeds, 1000 N·m/s, its
    joint ranges. Task: a circle of 20 cm radius at 1 to 6 rad/s, up to a metre from the
    start of the hand: mostly beyond the limits, often out of reach. With odd seeds
    `static_effort` is on, too.
    """
    robot, rng = panda(), np.random.default_rng(seed)
    lower, upper = robot.position_limits()
    q0 = 0.5 * (lower + upper) + 0.35 * (upper - lower) * rng.uniform(-1.0, 1.0, 7)
    own = own_limits(robot)
    limits = hsp.Limits(
        effort=own.effort * rng.uniform(0.7, 1.0),
        effort_rate=1000.0,
        velocity=own.velocity * rng.uniform(0.2, 0.5),
        static_effort=1.0 if seed % 2 else None,
    )
    start = robot.state(0.0, q0, np.zeros(7)).position("panda_tcp")
    away = rng.uniform(0.0, 0.5) * rng.normal(size=3)
    center, rate = start + away, rng.uniform(1.0, 6.0)
    path = hsp.Circle(0.2, rate, center, normal=rng.normal(size=3))
    gains = hsp.Gains(natural_frequency=rng.uniform(5.0, 12.0))
    task = hsp.FramePosition("panda_tcp", path, gains=gains)
    field = hsp.JointCentering()
    controller = hsp.Controller(robot, [task], field, limits=limits)
    assert controller.limits is not None
    return controller, controller.limits, q0


def roll_out(item: tuple[float, int]) -> Arm:
    """Run one random rollout of 0.8 s with a period, and measure it."""
    period, seed = item
    controller, limits, q0 = draw(seed)
    rollout = hsp.simulate(
        controller,
        q0,
        duration=0.8,
        control_period=period,
        log_period=period,
        integrator=Rk4(STEP),
    )
    excess = beyond(rollout, limits, period)
    status = rollout["status"]
    return Arm(
        completed=rollout.meta["status"] == "completed",
        rows=len(rollout),
        violated=np.array([(each > ROUNDING).any(axis=1).sum() for each in excess]),
        excess=np.array([each.max() for each in excess]),
        used=np.array([ratio.max() for ratio in limit_ratios(rollout, limits, period)]),
        limited=int((status == Status.LIMITED).sum()),
        relaxed=int((status == Status.RELAXED).sum()),
        relaxation=float(rollout["relaxation"].max()),
    )


def limit_ratios(
    rollout: hsp.Rollout, limits: RobotLimits, period: float
) -> tuple[Array, ...]:
    """Return the ratios of values to their limits; positions relative to mid-range."""
    q, v, tau = rollout["q"], rollout["v"], rollout["tau"]
    middle, half = 0.5 * (limits.upper + limits.lower), limits.upper - limits.lower
    return (
        np.abs(tau) / limits.effort,
        np.abs(np.diff(tau, axis=0)) / period / limits.effort_rate,
        np.abs(v) / limits.velocity,
        np.abs(q - middle) / (0.5 * half),
    )


def arm_table(runs: dict[float, list[Arm]]) -> str:
    """Return the table of all rollouts of the arm, a row per period."""
    names = ", ".join(EXCESS)
    lines = (
        f"| period | steps | violations: {names} | largest excess (negative: margin) | "
        "runs that use 97 % of a speed | limited steps | relaxed steps (runs), and the "
        "largest relaxation [rad/s²] |\n|--:|--:|--:|--:|--:|--:|--:|\n"
    )
    for period, arms in runs.items():
        rows = sum(run.rows for run in arms)
        violated = np.sum([run.violated for run in arms], axis=0)
        excess = np.max([run.excess for run in arms], axis=0)
        excess[np.abs(excess) <= ROUNDING] = 0.0
        used = np.array([run.used for run in arms])
        limited = sum(run.limited for run in arms) / rows
        lines += (
            f"| {1e3 * period:g} ms | {rows} | {', '.join(map(str, violated))} | "
            f"{', '.join(f'{each:.2g}' for each in excess)} | "
            f"{100.0 * (used[:, 2] > 0.97).mean():.0f} % | {100.0 * limited:.1f} % | "
            f"{sum(run.relaxed for run in arms)} "
            f"({sum(run.relaxed > 0 for run in arms)}), "
            f"{max(run.relaxation for run in arms):.2g} |\n"
        )
        assert all(run.completed for run in arms)
    return lines


def table(count: int) -> str:
    """Run so many rollouts at every period, and return the table."""
    runs = {
        period: run_parallel(
            roll_out,
            ((period, seed) for seed in range(count)),
            f"arm, {1e3 * period:g} ms",
        )
        for period in PERIODS
    }
    for period, arms in runs.items():
        for seed, run in enumerate(arms):
            if run.violated.any():
                print(f"{period} s, seed {seed}: {run}")
    return arm_table(runs)


# --------------------------------------------------------------------------- main

PARTS = {
    "limit_rollouts": (table, 1000),
    "limit_robots": (limit_robots.table, 96),
    "pushes": (limit_pushes.table, 20),
    "wrong_arms": (limits_on_wrong_arms.table, 40),
}
"""The functions of the page's sections, and their cases of a kind."""


def main() -> None:
    """Run the parts and write their tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", metavar="PART", default=[*PARTS])
    parser.add_argument(
        "--count", type=int, help="of cases, for a look: writes nothing"
    )
    options = parser.parse_args()
    for name in options.parts:
        make, count = PARTS[name]
        text = make(options.count or count)
        print(text)
        if not options.count:
            replace_section(RESULTS / "limits.md", name, f"\n{text}\n")


if __name__ == "__main__":
    main()
