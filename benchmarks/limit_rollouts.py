"""Count limit violations in 1000 rollouts of an arm and in pushes on legged robots.

    .venv/bin/python benchmarks/limit_rollouts.py [--rollouts N] [--pushes N]

All numbers are computed from the log: positions, velocities and efforts of every
period, and the differences of efforts. The tables are written into results/limits.md.
"""

import argparse
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np
from marked_sections import RESULTS, replace_section
from rich.progress import track

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import RobotLimits, own_limits
from hsp_control.control.actuation import Status
from hsp_control.robot.integrators import Rk4

T = TypeVar("T")
STEP = 1e-3  # of the integrator [s]
PERIODS = (1e-3, 2e-3, 5e-3, 10e-3)  # for which an effort is held [s]
ROUNDING = 1e-9  # excess over a limit that is not counted as a violation
EXCESS = ("effort [N·m]", "effort rate [N·m/s]", "velocity [rad/s]", "position [rad]")


# ------------------------------------------------------------------------ the arm


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
    """Return the arm, cached in each process."""
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


def beyond(
    rollout: hsp.Rollout, limits: RobotLimits, period: float
) -> tuple[Array, ...]:
    """Return by how much each limit is exceeded, step by step and joint by joint."""
    # Whatever is at -1: joints without a single coordinate have no limits.
    q = rollout["q"][:, limits.robot.dof_indices]
    v, tau = rollout["v"], rollout["tau"]
    return (
        np.abs(tau) - limits.effort,
        np.abs(np.diff(tau, axis=0)) / period - limits.effort_rate,
        np.abs(v) - limits.velocity,
        np.maximum(q - limits.upper, limits.lower - q),
    )


def limit_ratios(
    rollout: hsp.Rollout, limits: RobotLimits, period: float
) -> tuple[Array, ...]:
    """Return the ratio of each value to its limit; positions count from mid-range."""
    q, v, tau = rollout["q"], rollout["v"], rollout["tau"]
    middle, half = 0.5 * (limits.upper + limits.lower), limits.upper - limits.lower
    return (
        np.abs(tau) / limits.effort,
        np.abs(np.diff(tau, axis=0)) / period / limits.effort_rate,
        np.abs(v) / limits.velocity,
        np.abs(q - middle) / (0.5 * half),
    )


def arm_table(runs: dict[float, list[Arm]]) -> str:
    """Return the table of all rollouts of the arm, a row for each period."""
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


# ---------------------------------------------------------------------- the legs


class Legs(NamedTuple):
    """A legged robot and how it is pushed.

    Attributes:
        name: The bundled configuration.
        overrides: Changes of the configuration.
        frame: The frame that is pushed.
        body: The task whose last three rows are the orientation of the trunk.
        force_ratio: Force over weight.
        ground: Friction coefficient of the plant's ground.
    """

    name: str
    overrides: tuple[str, ...]
    frame: str
    body: str
    force_ratio: float
    ground: float


STANDING = ("tasks.center_of_mass.trajectory={type: hold}",)
LEGS = (
    Legs("talos_circle", STANDING, "base_link", "trunk", 0.2, 0.7),
    Legs("solo12_trunk", (), "base_link", "trunk", 0.2, 0.8),
)
START, PUSHED, DURATION = 1.0, 0.1, 4.0  # [s]


class Pushed(NamedTuple):
    """Measurements of a pushed run.

    Attributes:
        fell: Whether the trunk sank by 10 cm, tilted by 30°, or the run ended early.
        sunk: How far the root sank below its start [m].
        tilted: Largest error of the trunk's orientation [rad].
        moved: Largest error of the first task [m].
        planned: Largest used fraction of a friction cone, of the controller's forces.
        simulated: The same, of the engine's forces.
        pulls: Number of steps at which a force of the controller pulls.
        relaxed: Number of steps at which limits contradicted each other.
        rows: Number of steps.
        after: Error of the first task in the last 0.2 s [m].
    """

    fell: bool
    sunk: float
    tilted: float
    moved: float
    planned: float
    simulated: float
    pulls: int
    relaxed: int
    rows: int
    after: float


@cache
def weight(name: str) -> float:
    """Return a configuration's robot's weight [N]."""
    model = hsp.load_experiment(f"whole_body/{name}").robot.model
    return 9.81 * float(sum(inertia.mass for inertia in model.inertias))


def push(legs: Legs, seed: int) -> Pushed:
    """Run with a push in a random horizontal direction, and measure it."""
    heading = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi)
    force = legs.force_ratio * weight(legs.name)
    setting: dict[str, Any] = {
        "frame": legs.frame,
        "force": [force * float(np.cos(heading)), force * float(np.sin(heading)), 0.0],
        "start": START,
        "duration": PUSHED,
    }
    rollout = hsp.load_experiment(
        f"whole_body/{legs.name}",
        *legs.overrides,
        f"plant.pushes=[{setting}]",
        f"simulation.duration={DURATION}",
        f"simulation.log_period={STEP}",
    ).run()
    columns = rollout.columns
    names = [c.split(".")[1] for c in columns if c.endswith("friction_used")]
    forces = [
        c for c in columns if c.startswith("plant.contact.") and c[-6:] == ".force"
    ]
    first = next(iter(rollout.meta["tasks"]))
    moved = np.linalg.norm(rollout[f"task.{first}.error"][:, :3], axis=1)
    tilted = np.linalg.norm(rollout[f"task.{legs.body}.error"][:, -3:], axis=1).max()
    height = rollout["q"][:, 2]
    sunk = float(height[0] - height.min())
    completed = rollout.meta["status"] == "completed"
    return Pushed(
        fell=not completed or sunk > 0.1 or tilted > np.pi / 6.0,
        sunk=sunk,
        tilted=float(tilted),
        moved=float(moved.max()),
        planned=max(
            float(np.nanmax(rollout[f"contact.{n}.friction_used"])) for n in names
        ),
        simulated=max(cone_used(rollout[c], legs.ground) for c in forces),
        pulls=sum(
            int((rollout[f"contact.{n}.force"][:, 2] < 0.0).sum()) for n in names
        ),
        relaxed=int((rollout["status"] == Status.RELAXED).sum()),
        rows=len(rollout),
        after=float(moved[-200:].max()),
    )


def cone_used(force: Array, friction: float) -> float:
    """Return the largest used fraction of a cone while in contact (> 1 N) [-]."""
    contact = force[:, 2] > 1.0
    slope = np.linalg.norm(force[contact, :2], axis=1) / force[contact, 2]
    return float(slope.max(initial=0.0)) / friction


def leg_table(runs: dict[Legs, list[Pushed]]) -> str:
    """Return the table of all pushes."""
    lines = (
        "| robot | push | falls | worst error of the first task [mm], and at the end | "
        "worst tilt [°] | friction used: controller, engine | pulling forces | relaxed "
        "steps |\n|---|---|--:|--:|--:|--:|--:|--:|\n"
    )
    for legs, pushed in runs.items():
        force = legs.force_ratio * weight(legs.name)
        rows = sum(each.rows for each in pushed)
        lines += (
            f"| `{legs.name}` | {force:.0f} N for {PUSHED:g} s | "
            f"{sum(each.fell for each in pushed)} of {len(pushed)} | "
            f"{1e3 * max(each.moved for each in pushed):.2g}, "
            f"{1e3 * max(each.after for each in pushed):.2g} | "
            f"{np.rad2deg(max(each.tilted for each in pushed)):.2g} | "
            f"{100 * max(each.planned for each in pushed):.1f} %, "
            f"{100 * max(each.simulated for each in pushed):.1f} % | "
            f"{sum(each.pulls for each in pushed)} | "
            f"{sum(each.relaxed for each in pushed)} of {rows} |\n"
        )
    return lines


# --------------------------------------------------------------------------- main


def run_parallel(work: Callable[[Any], T], items: Iterable[Any], what: str) -> list[T]:
    """Return ``work(item)`` for every item, computed by two processes."""
    items = list(items)
    with ProcessPoolExecutor(2) as pool:
        done = pool.map(work, items, chunksize=max(1, min(10, len(items) // 4)))
        return list(track(done, what, total=len(items), transient=True))


def push_of(item: tuple[Legs, int]) -> Pushed:
    """Call `push` with one argument, as a process pool does."""
    return push(*item)


def main() -> None:
    """Run everything and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rollouts", type=int, default=1000)
    parser.add_argument("--pushes", type=int, default=20)
    parser.add_argument("--dry", action="store_true", help="print, write nothing")
    options = parser.parse_args()
    tables = {}
    if options.rollouts:
        runs = {
            period: run_parallel(
                roll_out,
                ((period, seed) for seed in range(options.rollouts)),
                f"arm, {1e3 * period:g} ms",
            )
            for period in PERIODS
        }
        tables["limit_rollouts"] = arm_table(runs)
        for period, arms in runs.items():
            for seed, run in enumerate(arms):
                if run.violated.any():
                    print(f"{period} s, seed {seed}: {run}")
    if options.pushes:
        pushed = {
            legs: run_parallel(
                push_of, ((legs, k) for k in range(options.pushes)), legs.name
            )
            for legs in LEGS
        }
        tables["pushes"] = leg_table(pushed)
    for name, table in tables.items():
        print(table)
        if not options.dry:
            replace_section(RESULTS / "limits.md", name, "\n" + table + "\n")


if __name__ == "__main__":
    main()
